// Prints where a device is, on the page docs/how-to/languages.md.
#include <cstdio>

#include "rtpm/gvd/client.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"

int main() {
  rtpm::rpc::Node node;
  rtpm::names::RegistryResolver resolver(node);
  node.use(resolver);
  auto arm = rtpm::gvd::DeviceClient::open(node, "lab/arm0");
  if (!arm) return std::fprintf(stderr, "%s\n", arm.error().text().c_str()), 1;
  const auto sample = arm->read();
  if (!sample) return 1;
  const auto& at = sample->pose.position_m;
  std::printf("the arm is at %.3f %.3f %.3f m\n", at.x, at.y, at.z);
}
