// rtpm-reference-server: serves lab/arm0, a lab.Arm whose one method counts its runs. It has nothing
// but the protocol: implementers of spec/ test their clients with it, and rtpm-conform tests it.
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

#include "rtpm/base/bytes.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/options/server_options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"

namespace {

constexpr const char* kProgram = "rtpm-reference-server";
constexpr std::string_view kPath = "lab/arm0";
constexpr std::uint16_t kCountMethod = 2;

// As rtpmc makes it of README.md's schema; written by hand, as the method takes any payload.
constexpr std::array<rtpm::rpc::MethodDescriptor, 1> kMethods{
    {{.id = kCountMethod, .name = "count", .fingerprint = 0x62e5d0b3}}};
constexpr rtpm::rpc::InterfaceDescriptor kInterface{.name = "lab.Arm",
                                                    .fingerprint = 0x27acad410acb7c45,
                                                    .methods = kMethods,
                                                    .text = R"(service lab.Arm
method 2 count
request empty rtpm.Empty
reply struct lab.CountReply
struct lab.Run size 8 align 8 {
  0 count: uint64
}
table lab.CountReply {
  0 run: object lab.Run required
}
table rtpm.Empty {
}
)"};

class CountingServant final : public rtpm::rpc::Servant {
 public:
  [[nodiscard]] const rtpm::rpc::InterfaceDescriptor& interface() const noexcept override {
    return kInterface;
  }
  rtpm::rpc::DispatchResult dispatch(std::uint16_t method_id, rtpm::ConstBytes,
                                     rtpm::MutableBytes reply,
                                     const rtpm::rpc::CallContext&) override {
    if (method_id != kCountMethod) return {rtpm::wire::Status::kNoSuchMethod, 0};
    rtpm::store_le<std::uint64_t>(reply.data(), ++run_count_);
    return {rtpm::wire::Status::kOk, sizeof(std::uint64_t)};
  }

 private:
  std::atomic<std::uint64_t> run_count_{0};
};

int fail(const std::string& text) {
  rtpm::rt::print_error(kProgram, text);
  return 1;
}

int serve(const rtpm::options::ServerSettings& settings) {
  const rtpm::program::StopSignal stop;
  const auto prepared = rtpm::options::prepare(settings);
  if (!prepared) return fail(prepared.error().text());
  CountingServant servant;
  auto server = rtpm::rpc::Server::create(settings.server);
  if (!server) return fail(server.error().text());
  if (const auto added = (*server)->add(kPath, servant); !added) return fail(added.error().text());
  if (const auto started = (*server)->start(); !started) return fail(started.error().text());
  rtpm::options::show_setup(settings, **server, kProgram);
  std::printf("%s\n", (*server)->url(kPath).c_str());
  std::fflush(stdout);
  while (!stop.wait_for(std::chrono::seconds{1})) {
  }
  (*server)->stop();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  rtpm::options::ServerSettings settings;
  rtpm::options::Options options(kProgram, "a server to test implementations of the protocol with");
  rtpm::options::add_server(options, settings);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  return serve(settings);
}
