#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace mapjoin::cli {

/// The files that a command writes: all of them appear, or none.
///
///     OutputFiles files;
///     files.expect("out.g2o");              // early: before work is done for nothing
///     files.write("out.g2o", [&](const std::filesystem::path& at) { write_g2o(at, values); });
///     files.commit();
///
/// Files are written under temporary names beside their places and get their names in commit().
class OutputFiles {
 public:
  OutputFiles() = default;
  ~OutputFiles();
  OutputFiles(const OutputFiles&) = delete;
  OutputFiles& operator=(const OutputFiles&) = delete;

  /// \throws FileError when nothing can be written there: no such directory, not permitted.
  static void expect(const std::filesystem::path& path);
  void write(const std::filesystem::path& path,
             const std::function<void(const std::filesystem::path&)>& writer);
  void write_text(const std::filesystem::path& path, const std::string& text);
  void commit();

 private:
  struct File {
    std::filesystem::path temporary, path;
  };
  std::vector<File> files_;
};

/// A folder that appears with all its files or not at all: what is written into path() shows under
/// its name after commit().
class OutputFolder {
 public:
  /// \throws FileError when there is something already, or when nothing can be made there.
  explicit OutputFolder(const std::filesystem::path& target);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  const std::filesystem::path& path() const { return temporary_; }
  void commit();

 private:
  std::filesystem::path target_, temporary_;
};

/// Kinds of result files, by extension.
enum class OutputFormat { kG2o, kNative, kTum };

/// \throws InputError when the extension is none of .g2o, .map, .tum.
OutputFormat output_format(const std::filesystem::path& path);

/// OUT.g2o for piece 0, OUT.2.g2o for piece 1, ...
std::filesystem::path piece_path(const std::filesystem::path& path, std::size_t piece);

}  // namespace mapjoin::cli
