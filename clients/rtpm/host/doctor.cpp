#include <algorithm>
#include <cstdio>

#include "cli/command.hpp"
#include "host/commands.hpp"
#include "rtpm/rt/report.hpp"

namespace rtpm::tool {
namespace {

int doctor(Context&) {
  const auto notes = rt::survey_host();
  std::fputs(rt::to_text(notes).c_str(), stdout);
  const bool is_refused = std::ranges::any_of(
      notes, [](const rt::SetupNote& note) { return note.grant == rt::Grant::kRefused; });
  return is_refused ? kFailed : kDone;
}

}  // namespace

void add_doctor(CLI::App& program, Context& context) {
  add_command(program, context, "doctor", "Show what this host gives to real-time programs",
              "Each thing that is missing has its remedy; then the exit code is 1.\n", &doctor);
}

}  // namespace rtpm::tool
