# Fails where an #include goes against the order of the layers. Run: cmake -DROOT=<project> -DWORK=<scratch> -P layers.cmake
#
cmake_minimum_required(VERSION 3.25)

# Each folder lists the folders that its files may include from, itself left out. To add a layer: add its line here.
set(may_include_mln "")
set(may_include_grounding mln)
set(may_include_inference grounding mln)
set(may_include_learning inference grounding mln)
set(may_include_perception_bridge mln)  # and results; never the inside of grounding
set(may_include_cli perception_bridge learning inference grounding mln)
set(layers mln grounding inference learning perception_bridge cli)
# Below these folders nothing of the library is: a layer includes none of them.
set(outside cli tests bench examples)

# The bad edges under `root`, as "file: folder", in `result`.
function(find_bad_edges root result)
  set(bad "")
  foreach(layer IN LISTS layers)
    file(GLOB_RECURSE files ${root}/${layer}/*.h ${root}/${layer}/*.cpp)
    foreach(file IN LISTS files)
      file(STRINGS ${file} lines REGEX "^[ \t]*#[ \t]*include[ \t]+\"")
      foreach(line IN LISTS lines)
        string(REGEX REPLACE "^[^\"]*\"(\\.\\./)*([^\"]*)\".*$" "\\2" path "${line}")
        if(path STREQUAL "sherlog.h")
          set(folder "sherlog.h")  # the umbrella is for users, not for the library
        elseif(path MATCHES "^([a-z_]+)/")
          set(folder ${CMAKE_MATCH_1})
        else()
          continue()
        endif()
        if(folder STREQUAL layer OR folder IN_LIST may_include_${layer})
          continue()
        endif()
        if(folder IN_LIST layers OR folder IN_LIST outside OR (folder STREQUAL "sherlog.h" AND NOT layer STREQUAL "cli"))
          list(APPEND bad "${file}: ${folder}")
        endif()
      endforeach()
    endforeach()
  endforeach()
  set(${result} "${bad}" PARENT_SCOPE)
endfunction()

# The check itself: planted edges are found, allowed ones are not.
file(REMOVE_RECURSE ${WORK})
file(WRITE ${WORK}/mln/good.h "#include \"mln/ids.h\"\n#include <vector>\n")
file(WRITE ${WORK}/inference/good.h "#include \"grounding/network.h\"\n")
file(WRITE ${WORK}/mln/back.cpp "#include \"grounding/network.h\"\n")
file(WRITE ${WORK}/grounding/relative.h "#include \"../inference/inference.h\"\n")
file(WRITE ${WORK}/perception_bridge/inside.h "  #  include \"grounding/network.h\"\n")
file(WRITE ${WORK}/inference/program.cpp "#include \"cli/report.h\"\n")
file(WRITE ${WORK}/grounding/umbrella.cpp "#include \"sherlog.h\"\n")
find_bad_edges(${WORK} planted)
list(LENGTH planted found)
if(NOT found EQUAL 5)
  message(FATAL_ERROR "the layer check is broken: it should find 5 planted edges and finds ${found}: ${planted}")
endif()

find_bad_edges(${ROOT} bad)
if(bad)
  list(JOIN bad "\n  " text)
  message(FATAL_ERROR "includes against the order of the layers:\n  ${text}")
endif()
message(STATUS "layers: no edge against their order")
