// A network that loses, repeats and reorders datagrams before a server of this host:
//   interop_relay PORT
// It prints its own port, and ends with its input.
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <string>

#include "rtpm/test/faulty_relay.hpp"

int main(int count, char** arguments) {
  if (count != 2) {
    std::fputs("usage: interop_relay PORT\n", stderr);
    return 2;
  }
  const rtpm::test::FaultyRelay relay(static_cast<std::uint16_t>(std::stoul(arguments[1])), {});
  std::printf("%u\n", relay.port());
  std::fflush(stdout);
  while (std::cin.get() != std::char_traits<char>::eof()) {
  }
  return 0;
}
