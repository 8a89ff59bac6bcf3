#include "mapjoin/cli/command.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

namespace mapjoin::cli {

namespace {

constexpr std::size_t kTextWidth = 66;  // of descriptions, beside 30 columns of names

std::string wrapped(const std::string& text) {
  std::string out;
  std::size_t column = 0;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    if (column > 0 && column + 1 + (end - at) > kTextWidth) {
      out += '\n';
      column = 0;
    } else if (column > 0) {
      out += ' ';
      ++column;
    }
    out.append(text, at, end - at);
    column += end - at;
    at = end + 1;
  }
  return out;
}

/// Breaks the lines of options' descriptions.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_desc(const CLI::Option* option) const override {
    return wrapped(CLI::Formatter::make_option_desc(option));
  }
  std::string make_description(const CLI::App* app) const override {
    return CLI::Formatter::make_description(app) + "\n";
  }
};

}  // namespace

Option& Option::type_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Option& Option::required() {
  option_->required();
  return *this;
}

Option& Option::show_default() {
  option_->capture_default_str();
  return *this;
}

Option& Option::separated_by(char delimiter) {
  option_->delimiter(delimiter);
  return *this;
}

Option& Option::one_of(const std::vector<std::string>& words) {
  option_->check(CLI::IsMember(words));
  return *this;
}

Option& Option::within(int least, int most) {
  option_->check(CLI::Range(least, most));
  return *this;
}

Option& Option::within(double least, double most) {
  option_->check(CLI::Range(least, most));
  return *this;
}

Option& Option::not_negative() {
  option_->check(CLI::NonNegativeNumber);
  return *this;
}

Option& Option::size_or_zero(double least) {
  option_->transform(CLI::AsSizeValue(false))
      ->check([least](const std::string& bytes) -> std::string {
        const double size = std::stod(bytes);
        if (size == 0.0 || size >= least) return {};
        return bytes + " bytes are less than any run needs; did you mean " + bytes + "MB?";
      });
  return *this;
}

Option& Option::needs(const Option& other) {
  option_->needs(other.option_);
  return *this;
}

Option& Option::excludes(const Option& other) {
  option_->excludes(other.option_);
  return *this;
}

Command Command::add_command(const std::string& name, const std::string& description) {
  return Command(*app_->add_subcommand(name, description));
}

template <class T>
Option Command::add_option(const std::string& names, T& target, const std::string& help) {
  return Option(*app_->add_option(names, target, help));
}

Option Command::add_flag(const std::string& names, bool& target, const std::string& help) {
  return Option(*app_->add_flag(names, target, help));
}

Option Command::option(const std::string& name) const { return Option(*app_->get_option(name)); }

bool Command::has(const std::string& name) const { return app_->count(name) > 0; }

void Command::examples(const std::string& text) { app_->footer(text); }

void Command::run(std::function<void()> what) { app_->callback(std::move(what)); }

int run_program(const ProgramText& text, const std::vector<void (*)(Command&)>& commands, int argc,
                char** argv) {
  CLI::App app(text.description, text.name);
  app.formatter(std::make_shared<HelpFormatter>());
  app.set_version_flag("--version", text.version);
  app.require_subcommand(1);
  app.footer(text.footer);
  Command program(app);
  for (const auto& add : commands) add(program);
  try {
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::Success& asked) {  // help or version
    return app.exit(asked);
  } catch (const CLI::ParseError& error) {
    std::string command = text.name;
    for (const CLI::App* chosen : app.get_subcommands()) command += " " + chosen->get_name();
    throw UsageError(fmt::format("{}\nSee '{} --help'.", error.what(), command));
  }
}

#define MAPJOIN_INSTANTIATE(...) \
  template Option Command::add_option(const std::string&, __VA_ARGS__&, const std::string&);
MAPJOIN_INSTANTIATE(std::string)
MAPJOIN_INSTANTIATE(std::vector<std::string>)
MAPJOIN_INSTANTIATE(double)
MAPJOIN_INSTANTIATE(int)
MAPJOIN_INSTANTIATE(std::uint32_t)
MAPJOIN_INSTANTIATE(std::uint64_t)
MAPJOIN_INSTANTIATE(std::int64_t)
MAPJOIN_INSTANTIATE(std::optional<double>)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin::cli
