# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# Windows on x86-64, by Debian's mingw-w64 with POSIX threads. The libraries lie where tools/windows puts them.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR x86_64)
set(mingw x86_64-w64-mingw32)
set(CMAKE_C_COMPILER ${mingw}-gcc-posix)
set(CMAKE_CXX_COMPILER ${mingw}-g++-posix)
set(CMAKE_RC_COMPILER ${mingw}-windres)
set(CMAKE_CROSSCOMPILING_EMULATOR /usr/lib/wine/wine64)

set(windows_libraries ${CMAKE_CURRENT_LIST_DIR}/../../build/windows-libraries)
cmake_path(NORMAL_PATH windows_libraries)
set(CMAKE_FIND_ROOT_PATH ${CMAKE_PREFIX_PATH} ${windows_libraries} /usr/${mingw})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_LIBDIR} ${windows_libraries}/lib/pkgconfig)

set(ZLIB_LIBRARY /usr/${mingw}/lib/libz.a CACHE FILEPATH "")

# what is built needs no libraries of the compiler's beside it
set(CMAKE_EXE_LINKER_FLAGS_INIT "-static -Wl,--stack,8388608") # as much as on Linux
set(CMAKE_SHARED_LINKER_FLAGS_INIT -static)
