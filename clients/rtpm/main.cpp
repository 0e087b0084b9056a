// rtpm: inspects, calls, records and replays RTPM objects from a terminal, without generated code.
#include "cli/program.hpp"

int main(int argc, char** argv) {
  rtpm::tool::Context context;
  const auto program = rtpm::tool::make_program(context);
  return rtpm::tool::run_program(*program, context, argc, argv);
}
