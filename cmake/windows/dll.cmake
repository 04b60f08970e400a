# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# semrover.dll, which shows what SR_API marks, with its version as a resource, and semrover.lib to link to it
enable_language(RC)
configure_file(cmake/windows/version.rc.in ${CMAKE_BINARY_DIR}/generated/version.rc @ONLY)
target_sources(semrover_c PRIVATE ${CMAKE_BINARY_DIR}/generated/version.rc)
target_compile_definitions(semrover_c PRIVATE SR_LIBRARY)
set(names ${CMAKE_BINARY_DIR}/semrover.def)
target_link_options(semrover_c PRIVATE -Wl,--gc-sections,--output-def,${names})
set_target_properties(semrover_c PROPERTIES PREFIX "" IMPORT_PREFIX "" IMPORT_SUFFIX .lib)
# in the form of Visual Studio's, which GNU's ld reads as well
find_program(DLLTOOL llvm-dlltool REQUIRED)
add_custom_command(TARGET semrover_c POST_BUILD VERBATIM
    COMMAND ${DLLTOOL} -m i386:x86-64 -D semrover.dll -d ${names} -l $<TARGET_LINKER_FILE:semrover_c>)
