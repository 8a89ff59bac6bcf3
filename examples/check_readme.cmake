# Fails when the program shown in README.md is not, to the letter, 00_first_map.cpp.
file(READ "${CMAKE_CURRENT_LIST_DIR}/00_first_map.cpp" program)
file(READ "${CMAKE_CURRENT_LIST_DIR}/../README.md" readme)
string(FIND "${readme}" "```cpp\n${program}```\n" found)
if(found EQUAL -1)
  message(FATAL_ERROR "README.md does not show examples/00_first_map.cpp as it is: copy it there")
endif()
