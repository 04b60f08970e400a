# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# `cmake --install BUILD --prefix DIR --component library`: libsemrover.so, its headers, what tells CMake
# (find_package(semrover)) and pkg-config of them, and sample hosts to build against them (share/semrover/host)
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set_target_properties(semrover_c PROPERTIES EXPORT_NAME semrover)
target_include_directories(semrover_c INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
install(TARGETS semrover_c EXPORT semrover COMPONENT library
    RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT library
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT library)
install(DIRECTORY tools/host DESTINATION ${CMAKE_INSTALL_DATADIR}/semrover COMPONENT library)
install(FILES engine/semrover.h engine/semrover_draw.h engine/semrover_renderer.h engine/semrover_vulkan.h engine/semrover_gl.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT library)
set(semrover_cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/semrover)
install(EXPORT semrover NAMESPACE semrover:: FILE semroverConfig.cmake DESTINATION ${semrover_cmake_folder}
    COMPONENT library)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/semroverConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/semroverConfigVersion.cmake DESTINATION ${semrover_cmake_folder}
    COMPONENT library)
# the prefix is told from where the file lies, so that the tree may be moved
function(write_pkgconfig file libdir)
    file(RELATIVE_PATH up /${libdir}/pkgconfig /)
    file(CONFIGURE OUTPUT ${file} @ONLY CONTENT
"prefix=\${pcfiledir}/@up@
Name: semrover
Description: streets of coloured points from labels, on any Vulkan device
Version: @PROJECT_VERSION@
Cflags: -I\${prefix}/@CMAKE_INSTALL_INCLUDEDIR@
Libs: -L\${pcfiledir}/.. -lsemrover
")
endfunction()
write_pkgconfig(semrover.pc ${CMAKE_INSTALL_LIBDIR})
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/semrover.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT library)
