#include "mapjoin/cli/output.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "mapjoin/graph/error.h"

namespace mapjoin::cli {

namespace fs = std::filesystem;

namespace {

fs::path directory_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

}  // namespace

OutputFiles::~OutputFiles() {
  std::error_code ignored;
  for (const File& file : files_) fs::remove(file.temporary, ignored);
}

void OutputFiles::expect(const fs::path& path) {
  std::error_code ignored;
  const fs::path directory = directory_of(path);
  if (!fs::is_directory(directory, ignored)) {
    throw FileError(fmt::format("cannot write {}: there is no directory {}; create it first",
                                path.string(), directory.string()));
  }
  if (fs::is_directory(path, ignored)) {
    throw FileError(fmt::format("cannot write {}: it is a directory; name a file", path.string()));
  }
  if (access(directory.c_str(), W_OK | X_OK) != 0) {
    throw FileError(fmt::format("cannot write {}: {}; choose another place", path.string(),
                                std::strerror(errno)));
  }
}

void OutputFiles::write(const fs::path& path, const std::function<void(const fs::path&)>& writer) {
  std::error_code ignored;
  if (fs::exists(path, ignored) && !fs::is_regular_file(path, ignored)) {
    writer(path);  // a pipe, /dev/stdout
    return;
  }
  const fs::path target = fs::weakly_canonical(path);  // behind symbolic links
  const std::string name = fmt::format(".{}.{}.{}{}", target.stem().string(), getpid(),
                                       files_.size(), target.extension().string());
  files_.push_back({directory_of(target) / name, target});
  writer(files_.back().temporary);
}

void OutputFiles::write_text(const fs::path& path, const std::string& text) {
  write(path, [&](const fs::path& at) {
    std::ofstream stream(at, std::ios::binary);
    stream << text;
    stream.close();
    if (!stream) {
      throw FileError(fmt::format("cannot write {}: {}", path.string(), std::strerror(errno)));
    }
  });
}

void OutputFiles::commit() {
  for (auto file = files_.begin(); file != files_.end(); ++file) {
    std::error_code error;
    fs::rename(file->temporary, file->path, error);
    if (error) {
      std::error_code ignored;
      for (auto done = files_.begin(); done != file; ++done) fs::remove(done->path, ignored);
      throw FileError(fmt::format("cannot write {}: {}", file->path.string(), error.message()));
    }
  }
  files_.clear();
}

OutputFolder::OutputFolder(const fs::path& target)
    : target_(target.has_filename() ? target : target.parent_path()) {
  std::error_code error;
  if (fs::exists(target_, error) && (!fs::is_directory(target_, error) || !fs::is_empty(target_))) {
    throw FileError(
        fmt::format("{} is there already: name a folder that is new or empty", target.string()));
  }
  temporary_ = target_.parent_path() / fmt::format(".{}.{}", target_.filename().string(), getpid());
  if (!fs::create_directory(temporary_, error)) {
    const std::string why = error ? error.message() : "a leftover is in the way";
    throw FileError(fmt::format("cannot make the folder {}: {}", target.string(), why));
  }
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove_all(temporary_, ignored);
}

void OutputFolder::commit() {
  std::error_code error;
  fs::rename(temporary_, target_, error);
  if (error) throw FileError(fmt::format("cannot write {}: {}", target_.string(), error.message()));
  temporary_.clear();
}

OutputFormat output_format(const fs::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".g2o") return OutputFormat::kG2o;
  if (extension == ".map") return OutputFormat::kNative;
  if (extension == ".tum") return OutputFormat::kTum;
  throw InputError(fmt::format(
      "--output {}: the ending says what is written; use .g2o, .map (native) or .tum (trajectory)",
      path.string()));
}

fs::path piece_path(const fs::path& path, std::size_t piece) {
  if (piece == 0) return path;
  fs::path out = path;
  out.replace_extension(fmt::format("{}{}", piece + 1, path.extension().string()));
  return out;
}

}  // namespace mapjoin::cli
