#include "cli/output.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "os/system.hpp"
#include "rtpm/program/terminal.hpp"

namespace rtpm::tool {
namespace {

const char* code_of(Colour colour) {
  switch (colour) {
    case Colour::kRed:
      return "31";
    case Colour::kGreen:
      return "32";
    case Colour::kYellow:
      return "33";
    case Colour::kGrey:
      return "90";
    case Colour::kBold:
      return "1";
  }
  return "0";
}

}  // namespace

void print_json(const Json& document) {
  print_line(document.dump(-1, ' ', false, Json::error_handler_t::replace));
}

void print_line(std::string_view text) {
  std::printf("%.*s\n", static_cast<int>(text.size()), text.data());
  std::fflush(stdout);
}

bool is_terminal() {
  return os::is_terminal(os::Stream::kOutput);
}
bool is_error_terminal() {
  return os::is_terminal(os::Stream::kError);
}

std::size_t terminal_width() {
  constexpr std::size_t kWidth = 100;
  return std::max<std::size_t>(program::terminal_width(kWidth), 40);
}

std::string coloured(std::string_view text, Colour colour) {
  const char* const no_colour = std::getenv("NO_COLOR");
  const bool is_refused = no_colour != nullptr && *no_colour != '\0';
  if (is_refused || !is_terminal()) return std::string(text);
  return "\x1b[" + std::string(code_of(colour)) + "m" + std::string(text) + "\x1b[0m";
}

}  // namespace rtpm::tool
