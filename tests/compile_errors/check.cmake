# Compiles examples/line2.h with one deliberate mistake at a time, and reads what the compiler says:
# its first error must name the member at fault.
#
#   cmake -DCOMPILER=<path> -DINCLUDES=<dir;dir> -DEXAMPLE=<line2.h> -DWORK=<dir> -P check.cmake

file(READ "${EXAMPLE}" right)
# The type's own static_assert would say it too; what is tested is the use.
string(REPLACE "static_assert(mapjoin::VariableType<Line>);" "" right "${right}")
set(flags -std=c++20)
list(REMOVE_ITEM INCLUDES "")
list(REMOVE_DUPLICATES INCLUDES)
foreach(dir IN LISTS INCLUDES)
  list(APPEND flags "-I${dir}") # of directories that compilers search anyway, ignored by them
endforeach()
file(MAKE_DIRECTORY "${WORK}")
set(mistakes 0)

# What is the same in all of them is read once; both GCC and Clang look for it beside the header.
file(WRITE "${WORK}/same.h" "#include \"mapjoin/graph/measurement_graph.h\"\n"
     "#include \"mapjoin/graph/values.h\"\n")
execute_process(COMMAND "${COMPILER}" ${flags} -x c++-header "${WORK}/same.h" -o "${WORK}/same.h.gch"
                COMMAND_ERROR_IS_FATAL ANY)

function(compile text)
  file(WRITE "${WORK}/mistaken.h" "${text}")
  execute_process(
    COMMAND "${COMPILER}" ${flags} -fsyntax-only -include "${WORK}/same.h" ${ARGN}
            "-DMISTAKEN=\"${WORK}/mistaken.h\"" "${CMAKE_CURRENT_LIST_DIR}/use.cpp"
    RESULT_VARIABLE result
    OUTPUT_VARIABLE output
    ERROR_VARIABLE output)
  set(result "${result}" PARENT_SCOPE)
  set(output "${output}" PARENT_SCOPE)
endfunction()

# mistake(<what to replace in the header> <by what> <what the first error says>)
function(mistake from to expected)
  string(FIND "${right}" "${from}" at)
  if(at LESS 0)
    message(FATAL_ERROR "not in ${EXAMPLE}: ${from}")
  endif()
  string(REPLACE "${from}" "${to}" wrong "${right}")
  math(EXPR mistakes "${mistakes} + 1")
  set(mistakes "${mistakes}" PARENT_SCOPE)
  set(uses "-DUSE_MEASUREMENTS")
  if(mistakes EQUAL 1)
    list(APPEND uses "-DUSE_VALUES")
  endif()
  foreach(use IN LISTS uses)
    compile("${wrong}" ${use})
    string(REGEX MATCH "[^\n]*error:[^\n]*" first "${output}")
    string(FIND "${first}" "${expected}" at)
    if(result EQUAL 0 OR at LESS 0)
      message(SEND_ERROR "[${from}] -> [${to}]\n  should say: ${expected}\n  says: ${first}\n${output}")
    endif()
  endforeach()
endfunction()

compile("${right}")
if(NOT result EQUAL 0)
  message(FATAL_ERROR "without a mistake it does not compile:\n${output}")
endif()

# Missing.
mistake("Value<S> retract(" "Value<S> rectract(" "`retract` is missing or wrong")
mistake("Vec<2, S> local(" "Vec<2, S> difference(" "`local` is missing or wrong")
mistake("Value<S> transform(" "Value<S> move(" "`transform` is missing or wrong")
mistake("int dim = 2" "int size = 2" "`dim` is missing or wrong")
mistake("int ambient = 2" "int space = 2" "`ambient` is missing or wrong")
mistake("string_view name" "string_view title" "`name` is missing or wrong")
mistake("FrameAction action" "FrameAction kind" "`action` is missing or wrong")
mistake("Value" "State" "`Value` is missing or wrong")
mistake("static Vec<2> direction(" "static Vec<2> normal(" "`direction` is missing")
mistake("struct Line {" "class Line {" "`ambient` is missing or wrong: public:")
# Wrong.
mistake("int ambient = 2" "int ambient = 4" "`ambient` is missing or wrong")
mistake("name = \"line\"" "name = \"oriented line\"" "`name` is missing or wrong")
mistake("S a, d;" "double a, d;" "`Value` is missing or wrong")
mistake("S a, d;" "S a, d; bool seen;" "`Value` is missing or wrong")
mistake("int dim = 2" "int dim = 3" "`local` is missing or wrong")
mistake("static Vec<2, S> local(" "static S local(" "`local` is missing or wrong")
mistake("static Vec<2, S> local(" "static Vec<3, S> local(" "`local` is missing or wrong")
mistake("const mapjoin::Rigid<2, S>& T," "const mapjoin::Rigid<2, S>& T, S,"
        "`transform` is missing or wrong")
mistake("const mapjoin::Rigid<2, S>& T," "const mapjoin::Rigid<3, S>& T,"
        "`transform` is missing or wrong")
mistake("static Vec<2> direction(" "static Vec<3> direction(" "`direction` is wrong")
mistake("static double offset(const Value<double>& x) { return x.d; }"
        "static Vec<2> offset(const Value<double>& x) { return Vec<2>(x.d, x.d); }"
        "`offset` is wrong")
mistake("static double offset(" "static double gauge(const Value<double>&); static double offset("
        "`gauge` is wrong")
mistake("static double offset(" "static Vec<3> position(const Value<double>&); static double offset("
        "`position` is wrong")
mistake("static double offset(" "static Vec<3> transport(const Value<double>&); static double offset("
        "`transport` is wrong")
message(STATUS "${mistakes} mistakes, each named in the first error")
