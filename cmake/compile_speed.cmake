# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# What makes builds quick and results no different: a cache, a linker, levels of optimization, precompiled headers, and
# sources that are compiled together. Nothing here says what a program consists of.
option(SEMROVER_UNITY "compile some eight sources at a time: less than half the time of a full build" ON)

find_program(CCACHE ccache)
if(CCACHE)
    # what ccache asks for to cache users of precompiled headers; and no path of this checkout in what it compares, so that
    # another checkout takes the same results
    set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros
        CCACHE_BASEDIR=${CMAKE_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${CCACHE})
    set(CMAKE_C_COMPILER_LAUNCHER ${CMAKE_CXX_COMPILER_LAUNCHER})
    add_compile_options($<$<COMPILE_LANG_AND_ID:CXX,GNU>:-fpch-preprocess>)
endif()
add_compile_options(-fmacro-prefix-map=${CMAKE_SOURCE_DIR}/=) # __FILE__ is a path within the repository
find_program(LLD ld.lld)
if(LLD AND NOT WIN32)
    add_link_options(-fuse-ld=lld)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # collecting garbage below a GiB takes a sixth of the time, most of it for the precompiled header
    add_compile_options("$<$<COMPILE_LANGUAGE:CXX>:SHELL:--param ggc-min-heapsize=1048576>")
    if(SEMROVER_UNITY) # GCC takes an included .cpp for a header, whose classes must not hold others of an unnamed namespace
        add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage>)
    endif()
endif()

# For what plans, reads, writes and calls: -O3 takes 1.6 times as long to compile and no command runs faster for it. The
# warning is a false alarm: at -O1 GCC cannot tell that an optional is empty. Nothing is compiled with less: the linker
# keeps one copy of an inline function for the whole program, also of one that a hot loop calls.
set(cold_options "$<$<CONFIG:Release>:-O1;-Wno-maybe-uninitialized>")

# the headers that cost most of the compile time; every file still includes what it uses
set(heavy_headers <filesystem> <fmt/format.h> <map> "${CMAKE_SOURCE_DIR}/runtime/base/json_allocator.h" <string>
    <tl/expected.hpp> <vector> <vulkan/vulkan.h>)

# precompile_headers(TARGET OWNER [HEADER...]): those of OWNER, which has the same options; where that is TARGET, the heavy
# ones and these
function(precompile_headers target owner)
    if("${target}" STREQUAL "${owner}")
        target_precompile_headers(${target} PRIVATE ${heavy_headers} ${ARGN})
    else()
        target_precompile_headers(${target} REUSE_FROM ${owner})
    endif()
endfunction()

# compile_cold(TARGET OWNER [HEADER...]): the same of a target that is cold
function(compile_cold target)
    target_compile_options(${target} PRIVATE "${cold_options}")
    precompile_headers(${target} ${ARGN})
endfunction()

# group_sources(FOLDER SOURCE...): some eight sources of a folder are compiled together, so names in unnamed namespaces
# differ within a folder. A source's name decides with which: a new one moves no others, but where a folder's number of
# groups doubles.
function(group_sources folder)
    list(LENGTH ARGN count)
    set(groups 1)
    while(groups LESS_EQUAL 16 AND count GREATER 12)
        math(EXPR groups "${groups} * 2")
        math(EXPR count "${count} / 2")
    endwhile()
    foreach(source ${ARGN})
        get_filename_component(name ${source} NAME_WE)
        string(MD5 hash ${name})
        string(SUBSTRING ${hash} 0 4 digits)
        math(EXPR group "0x${digits} % ${groups}")
        string(MAKE_C_IDENTIFIER ${folder}_${group} name)
        set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${name})
    endforeach()
endfunction()

# compile_alone(SOURCE...): not together with others of its folder
function(compile_alone)
    set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# compile_hot(SOURCE...): the few loops of the host that are hot, one by one
function(compile_hot)
    compile_alone(${ARGN})
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS -O3 SKIP_PRECOMPILE_HEADERS ON)
endfunction()
