// rtpm-instructions: runs each subject several times, for a tool that takes the median of their
// instructions, see tools/instructions.py. The first run also sets the subject up.
//
// rtpm-instructions --key prints the compiler and build, on which the counts depend; --list prints
// the subjects' symbols.
#include <algorithm>
#include <cstdio>
#include <string>
#include <string_view>

#include "subjects.hpp"

namespace rtpm::bench::micro {
namespace {

constexpr int kRunCount = 15;

void print_key() {
#ifdef __clang__
  std::string version = __clang_version__;
  version.resize(std::min(version.size(), version.find(' ')));
  const char* const compiler = "Clang";
#else
  const std::string version = __VERSION__;
  const char* const compiler = "GCC";
#endif
  std::printf("%s-%s-%s-%s\n", compiler, version.c_str(), RTPM_BENCH_PROCESSOR, RTPM_BENCH_BUILD);
}

}  // namespace
}  // namespace rtpm::bench::micro

int main(int argc, char** argv) {
  using namespace rtpm::bench::micro;
  const std::string_view argument = argc == 2 ? argv[1] : "";
  if (argument == "--key") {
    print_key();
    return 0;
  }
  for (const Subject& subject : subjects()) {
    if (argument == "--list") {
      std::printf("counted_%s\n", subject.name);
      continue;
    }
    for (int i = 0; i < kRunCount; ++i)
      subject.run();
  }
  return 0;
}
