# mapjoin_target_defaults(<target>): what every target of this repository is compiled with. All of it
# is PRIVATE: nobody who links mapjoin inherits it.

set(MAPJOIN_WARNINGS
    -Wall
    -Wextra
    -Wpedantic
    -Wshadow
    -Wnon-virtual-dtor
    -Woverloaded-virtual
    -Wold-style-cast)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # What GCC 12 concludes about memory after inlining at -O3 is often wrong, for std::string and for
  # Eigen's fixed-size storage alike. The sanitizers watch the same things in earnest.
  list(APPEND MAPJOIN_WARNINGS -Wno-maybe-uninitialized -Wno-array-bounds -Wno-restrict
       -Wno-stringop-overflow -Wno-stringop-overread)
  # A file's own types look like a header's when it is compiled as part of another one.
  if(MAPJOIN_UNITY_BUILD)
    list(APPEND MAPJOIN_WARNINGS -Wno-subobject-linkage)
  endif()
elseif(MAPJOIN_UNITY_BUILD)
  # Clang's reaches from a function of one file to the constants of another. GCC looks out for it.
  list(APPEND MAPJOIN_WARNINGS -Wno-shadow)
endif()

set(MAPJOIN_PRECOMPILED_HEADERS
    <Eigen/Dense>
    <fmt/format.h>
    <algorithm>
    <array>
    <cmath>
    <cstddef>
    <cstdint>
    <functional>
    <limits>
    <memory>
    <optional>
    <span>
    <string>
    <string_view>
    <tuple>
    <type_traits>
    <unordered_map>
    <utility>
    <vector>
    # What nearly every source includes of mapjoin itself: a quarter of the time of compiling one.
    <mapjoin/frames/anchors.h>
    <mapjoin/frames/change_frame.h>
    <mapjoin/graph/map.h>
    <mapjoin/graph/measurement_graph.h>)

function(mapjoin_target_defaults target)
  target_compile_features(${target} PRIVATE cxx_std_20)
  set_target_properties(
    ${target}
    PROPERTIES CXX_EXTENSIONS OFF
               UNITY_BUILD ${MAPJOIN_UNITY_BUILD}
               UNITY_BUILD_BATCH_SIZE 10)

  # Nothing here reads errno after a square root, and without it the compiler can vectorise one.
  target_compile_options(${target} PRIVATE ${MAPJOIN_WARNINGS} -fno-math-errno ${MAPJOIN_ARCH_FLAGS})
  if(MAPJOIN_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  # Bounds checks of the standard containers; they do not change the ABI.
  target_compile_definitions(${target} PRIVATE $<$<CONFIG:Debug>:_GLIBCXX_ASSERTIONS>)

  if(MAPJOIN_SANITIZE)
    set(sanitize -fsanitize=${MAPJOIN_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    if(MAPJOIN_SANITIZE_EXCEPT)
      list(APPEND sanitize -fno-sanitize=${MAPJOIN_SANITIZE_EXCEPT})
    endif()
    target_compile_options(${target} PRIVATE ${sanitize})
    target_link_options(${target} PRIVATE ${sanitize})
  endif()

  # CHOLMOD is to run on the BLAS that the administrator chose. Ceres may bring ATLAS, which comes
  # earlier among the libraries, is several times slower, and would be the one that CHOLMOD finds. So
  # programs name the right one before all libraries, and let no linker leave it out.
  get_target_property(type ${target} TYPE)
  if(type STREQUAL "EXECUTABLE")
    target_link_options(${target} PRIVATE "LINKER:--no-as-needed" ${BLAS_LIBRARIES})
  endif()

  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    # Otherwise a precompiled header carries its build time and ccache never sees it again.
    target_compile_options(${target} PRIVATE "SHELL:-Xclang -fno-pch-timestamp")
  endif()
endfunction()

# mapjoin_precompile_headers(<target> [REUSE_FROM <other target> | <more headers>...])
function(mapjoin_precompile_headers target)
  if(MAPJOIN_PRECOMPILE_HEADERS)
    if("${ARGV1}" STREQUAL "REUSE_FROM")
      target_precompile_headers(${target} REUSE_FROM ${ARGV2})
    else()
      target_precompile_headers(${target} PRIVATE ${MAPJOIN_PRECOMPILED_HEADERS} ${ARGN})
    endif()
  endif()
endfunction()
