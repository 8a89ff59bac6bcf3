#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

// What commands say of their arguments. CLI11 does the work, but takes the compiler nine seconds
// wherever its header is read, so that only command.cpp does.

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace mapjoin::cli {

/// An option or argument of a command. Refers to what the command holds.
class Option {
 public:
  explicit Option(CLI::Option& option) : option_(&option) {}

  Option& type_name(const std::string& name);  ///< what stands for its value in the help
  Option& required();
  Option& show_default();  ///< the target's value now, in the help
  Option& separated_by(char delimiter);
  Option& one_of(const std::vector<std::string>& words);
  Option& within(int least, int most);
  Option& within(double least, double most);
  Option& not_negative();
  /// A number of bytes, as in 600MB; 0, or `least` and more. What less is given may mean is said.
  Option& size_or_zero(double least);
  Option& needs(const Option& other);
  Option& excludes(const Option& other);

 private:
  CLI::Option* option_;
};

/// A command, or the program itself. Refers to CLI11's.
class Command {
 public:
  explicit Command(CLI::App& app) : app_(&app) {}

  Command add_command(const std::string& name, const std::string& description);
  /// `names`: "-o,--output", or without hyphens that of an argument by its place. `target` has the
  /// default, gets the value, and must live until the command has run. T: std::string, a vector of
  /// them, double, int, std::uint32_t, std::uint64_t, std::int64_t, or std::optional<double>.
  template <class T>
  Option add_option(const std::string& names, T& target, const std::string& help);
  Option add_flag(const std::string& names, bool& target, const std::string& help);
  Option option(const std::string& name) const;  ///< one that was added
  bool has(const std::string& name) const;       ///< does the command line have this option?
  void examples(const std::string& text);        ///< at the end of the help
  void run(std::function<void()> what);          ///< when the command line names the command

 private:
  CLI::App* app_;
};

/// The command line is not understood. The message ends with the command whose help to ask for.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct ProgramText {
  std::string name;
  std::string description;  ///< at the beginning of the help
  std::string version;
  std::string footer;
};

/// Runs the command that the command line names, or prints help or version. `commands` add one
/// each. \returns the exit code. \throws UsageError, and what the command throws.
int run_program(const ProgramText& text, const std::vector<void (*)(Command&)>& commands, int argc,
                char** argv);

}  // namespace mapjoin::cli
