// A gauge that is served and called, in one program that uses an installed RTPM.
#include <cstdio>
#include <gauge.rtpm.hpp>
#include <string>

#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

namespace {

class Gauge final : public plant::GaugeServant {
 public:
  rtpm::rpc::Result<void> read(rtpm::rpc::ReplyBuilder<plant::Reading>& reply,
                               const rtpm::rpc::CallContext&) override {
    auto& builder = reply.builder();
    const units::Temperature temperature(21.5);
    const auto names = builder.CreateVectorOfStrings({"inlet", "outlet"});
    reply.finish(plant::CreateReading(builder, &temperature, names));
    return {};
  }
};

int fail(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
  return 1;
}

}  // namespace

int main() {
  auto server = rtpm::rpc::Server::create({.realtime = rtpm::rt::RealtimeMode::kOff});
  if (!server) return fail(server.error().text());
  Gauge gauge;
  if (auto added = (*server)->add("plant/gauge", gauge); !added) return fail(added.error().text());
  if (auto started = (*server)->start(); !started) return fail(started.error().text());

  rtpm::rpc::Node node;
  auto remote = plant::GaugeClient::bind(node, (*server)->url("plant/gauge"));
  if (!remote) return fail(remote.error().text());
  const auto reading = remote->read();
  if (!reading) return fail(std::string(to_string(reading.error())));
  std::printf("the gauge shows %.1f degree, of %u gauges\n", (*reading)->temperature()->degree(),
              (*reading)->names()->size());
  return 0;
}
