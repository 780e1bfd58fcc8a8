# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
# The wheels of ROS 2 name the Python headers of the machine that built them (/opt/python/...), which do not exist here; CMake refuses targets
# with include folders that are not there. Loaded by -DCMAKE_PROJECT_INCLUDE; runs when all packages have been found.
function(drop_builders_python_headers)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(folders ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(folders)
      list(FILTER folders EXCLUDE REGEX "^/opt/python/")
      set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${folders}")
    endif()
  endforeach()
endfunction()
cmake_language(DEFER CALL drop_builders_python_headers)
