// One side of an interface, built from one version of its schema: it writes requests, serves them,
// and reads replies, each as a file, so that sides of different versions can be set against each
// other.
#include <flatbuffers/flatbuffers.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "arm.rtpm.hpp"

namespace {

namespace evolution = lab::evolution;
using rtpm::ConstBytes;
using rtpm::rpc::CallContext;

/// Says in its replies what it understood.
class Arm final : public evolution::ArmServant {
 public:
  rtpm::rpc::Result<evolution::Force> push(const evolution::Force& request,
                                           const CallContext&) override {
    return request;
  }
  rtpm::rpc::Result<void> ask(const evolution::Request& request,
                              rtpm::rpc::ReplyBuilder<evolution::Reply>& reply,
                              const CallContext&) override {
    const std::string text = (request.title() ? request.title()->str() : "none") + ' ' +
                             std::to_string(static_cast<int>(request.mode())) + ' ' +
                             std::to_string(request.rate_hz());
    auto& builder = reply.builder();
    const auto said = builder.CreateString(text);
    evolution::ReplyBuilder answer(builder);
    answer.add_text(said);
    answer.add_count(-1);
    reply.finish(answer.Finish());
    return {};
  }
#ifdef RTPM_EVOLUTION_REST
  rtpm::rpc::Result<void> rest(const CallContext&) override {
    return {};
  }
#endif
};

std::vector<std::byte> bytes_of(const char* file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

void write(const char* file, ConstBytes bytes) {
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

int ask(const char* file) {
  evolution::RequestT request;
  request.title = "take";
#ifdef RTPM_EVOLUTION_OWNER
  request.owner = "me";
#endif
#ifdef RTPM_EVOLUTION_REST
  request.gain = 2;
  request.notes.push_back(std::make_unique<evolution::NoteT>());
#endif
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(evolution::Request::Pack(builder, &request));
  write(file, rtpm::rpc::table_bytes(builder));
  return 0;
}

int serve(std::uint16_t method, const char* request_file, const char* reply_file) {
  Arm arm;
  alignas(16) std::array<std::byte, 4096> request{};
  alignas(16) std::array<std::byte, 4096> reply{};
  const std::vector<std::byte> bytes = bytes_of(request_file);
  std::copy(bytes.begin(), bytes.end(), request.begin());
  const auto result =
      arm.dispatch(method, {request.data(), bytes.size()}, reply,
                   {.priority = 0, .deadline = rtpm::kNever, .received = {}, .trace_id = 0});
  write(reply_file, {reply.data(), result.reply_size});
  return result.status == rtpm::wire::Status::kOk ? 0 : 3;
}

int read_reply(const char* file) {
  const std::vector<std::byte> bytes = bytes_of(file);
  if (!rtpm::rpc::is_valid_table<evolution::Reply>(bytes)) return 4;
  const auto& reply = *flatbuffers::GetRoot<evolution::Reply>(bytes.data());
  std::printf("%s %lld\n", reply.text() ? reply.text()->c_str() : "none",
              static_cast<long long>(reply.count()));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string verb = argc > 1 ? argv[1] : "";
  if (verb == "ask" && argc == 3) return ask(argv[2]);
  if (verb == "push" && argc == 3) {
    const evolution::Force force{};
    write(argv[2], rtpm::rpc::struct_bytes(force));
    return 0;
  }
  if (verb == "serve" && argc == 5) {
    return serve(static_cast<std::uint16_t>(std::stoi(argv[2])), argv[3], argv[4]);
  }
  if (verb == "read" && argc == 3) return read_reply(argv[2]);
  std::fputs("usage: peer ask|push FILE, serve METHOD REQUEST REPLY, read REPLY\n", stderr);
  return 2;
}
