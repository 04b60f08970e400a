# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0

# assets/page/ -> <build>/generated/page_assets.h: what `semrover page` fills in, so that the program needs no files
set(page_sources page.html player.html orbit.html page.css)
# one after the other they are the page's script
set(page_scripts page.js points.js camera.js player.js draw_webgl.js draw_canvas.js orbit.js check.js start.js)
list(TRANSFORM page_sources PREPEND ${CMAKE_SOURCE_DIR}/assets/page/)
list(TRANSFORM page_scripts PREPEND ${CMAKE_SOURCE_DIR}/assets/page/)

# `source` of `target` includes the header
function(add_page_header target source)
    set(header ${CMAKE_BINARY_DIR}/generated/page_assets.h)
    set(script ${CMAKE_SOURCE_DIR}/cmake/embed_page.cmake)
    add_custom_command(OUTPUT ${header}
        COMMAND ${CMAKE_COMMAND} "-DOUT=${header}" "-DFOLDER=${CMAKE_SOURCE_DIR}/assets/page" "-DSCRIPTS=${page_scripts}"
            -P ${script}
        DEPENDS ${script} ${page_sources} ${page_scripts} COMMENT "page assets" VERBATIM)
    target_sources(${target} PRIVATE ${header})
    set_source_files_properties(${source} PROPERTIES INCLUDE_DIRECTORIES ${CMAKE_BINARY_DIR}/generated)
endfunction()
