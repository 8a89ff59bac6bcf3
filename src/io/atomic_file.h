#pragma once

#include <filesystem>
#include <string_view>

namespace mapjoin {

/// Writes a file that appears complete or not at all.
///
/// The content goes to a temporary file in the same folder, which then takes the target's name in
/// one step: whoever reads the target meanwhile sees the old file or the new one. On any error the
/// temporary is removed and an existing target is untouched. A symbolic link is followed; what is
/// no regular file (a pipe, /dev/stdout) is written directly. \throws FileError that says what
/// could not be done.
void write_atomically(const std::filesystem::path& target, std::string_view content);

}  // namespace mapjoin
