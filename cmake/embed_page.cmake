# SPDX-FileCopyrightText: semrover authors
# SPDX-License-Identifier: Apache-2.0
# cmake -DOUT=HEADER -DFOLDER=assets/page "-DSCRIPTS=a.js;b.js" -P embed_page.cmake
set(header "// made by cmake/embed_page.cmake\n#pragma once\n\n#include <string_view>\n\nnamespace semrover::page_assets {\n\n")
foreach(entry "kPage;page.html" "kPlayer;player.html" "kOrbit;orbit.html" "kStyle;page.css")
    list(GET entry 0 name)
    list(GET entry 1 file)
    file(READ ${FOLDER}/${file} text)
    string(APPEND header "inline constexpr std::string_view ${name} = R\"page~(${text})page~\";\n\n")
endforeach()
string(APPEND header "inline constexpr std::string_view kScript =")
foreach(file ${SCRIPTS})
    file(READ ${file} text)
    string(APPEND header " R\"page~(${text})page~\"")
endforeach()
string(APPEND header ";\n\n} // namespace semrover::page_assets\n")
file(WRITE ${OUT} "${header}")
