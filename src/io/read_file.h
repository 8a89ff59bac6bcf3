#pragma once

#include <filesystem>
#include <string>

namespace mapjoin {

/// The whole of a file, in one piece. All readers work on text in memory: it is the fastest way
/// there is. \throws FileError that says why the file cannot be read (missing, a directory, no
/// permission).
std::string read_file(const std::filesystem::path& path);

}  // namespace mapjoin
