#include "side.hpp"

#include <cstdio>
#include <mutex>

#include "rtpm/rt/memory.hpp"

// serve:   prints "port N", then serves all samples until its input ends.
// call HOST:PORT:   calls every method of all samples.
namespace evolution {

void record(int sample, int method, const char* what, const std::string& bytes) {
  const rtpm::rt::AllowAllocationScope is_allowed;
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  std::printf("%d %d %s ", sample, method, what);
  for (const char byte : bytes)
    std::printf("%02x", static_cast<unsigned>(static_cast<unsigned char>(byte)));
  std::printf("\n");
}

void record_error(int sample, int method, std::string_view text) {
  std::printf("%d %d error %.*s\n", sample, method, static_cast<int>(text.size()), text.data());
}

namespace {

int serve() {
  rtpm::rpc::ServerConfig config;
  config.realtime = rtpm::rt::RealtimeMode::kOff;
  auto server = rtpm::rpc::Server::create(config);
  if (!server) return std::fprintf(stderr, "%s\n", server.error().text().c_str()), 1;
  for (const Sample& sample : kSamples) {
    if (auto added = (*server)->add(sample.path, *sample.servant); !added) {
      return std::fprintf(stderr, "%s\n", added.error().text().c_str()), 1;
    }
  }
  if (auto started = (*server)->start(); !started) {
    return std::fprintf(stderr, "%s\n", started.error().text().c_str()), 1;
  }
  std::printf("port %d\n", static_cast<int>((*server)->port()));
  std::fflush(stdout);
  while (std::getchar() != EOF) {
  }
  (*server)->stop();
  return 0;
}

int call(const std::string& address) {
  rtpm::rpc::Node node;
  for (const Sample& sample : kSamples)
    sample.call(node, "rtpm://" + address + '/' + sample.path);
  return 0;
}

}  // namespace
}  // namespace evolution

int main(int argc, char** argv) {
  return argc == 3 ? evolution::call(argv[2]) : evolution::serve();
}
