// Three answers of an experiment, pushed and recorded in process, and read back typed.
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>
#include <thread>
#include <trial.rtpm.events.hpp>

#include "rtpm/capture/live_recording.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/events/hub_server.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/rpc/node.hpp"

namespace {

using namespace std::chrono_literals;

int fail(const std::string& text) {
  std::fprintf(stderr, "%s\n", text.c_str());
  return 1;
}

rtpm::expected<void, rtpm::SetupError> record(rtpm::rpc::Node& node, const std::string& file) {
  auto served = rtpm::events::HubServer::create(node, {.name = ""});
  if (!served) return rtpm::unexpected{served.error()};
  auto recording = rtpm::capture::LiveRecording::start(node, file, {.hub = (*served)->url()});
  if (!recording) return rtpm::unexpected{recording.error()};
  auto answers = study::AnsweredSupplier::create((*served)->hub(), 3);
  if (!answers) return rtpm::unexpected{answers.error()};
  (*recording)->annotate("trial 1, left hand");
  for (const double stiffness : {400.0, 800.0, 1200.0}) {
    flatbuffers::FlatBufferBuilder builder;
    const auto comment = builder.CreateString("certain");
    builder.Finish(study::CreateAnswered(builder, stiffness, stiffness > 600, comment));
    if (!answers->push(builder)) return rtpm::setup_error("an answer was not pushed");
  }
  const auto until = std::chrono::steady_clock::now() + 20s;
  while ((*recording)->status().recorder.message_count < 4) {
    if (std::chrono::steady_clock::now() > until) {
      return rtpm::setup_error("what was pushed was not recorded within 20 s");
    }
    std::this_thread::yield();
  }
  return (*recording)->stop();
}

}  // namespace

int main() {
  const std::string file = std::filesystem::temp_directory_path() / "rtpm_embedded_trial.mcap";
  std::filesystem::remove(file);
  rtpm::rpc::Node node;
  if (const auto recorded = record(node, file); !recorded) return fail(recorded.error().text());
  auto reader = rtpm::recording::FileReader::open(file);
  if (!reader) return fail(reader.error().text());
  int count = 0;
  const auto read =
      rtpm::capture::read_events<study::AnsweredEvent>(**reader, [&](const auto& event) {
        ++count;
        std::printf("%g N/m: %s, %s\n", event.payload.stiffness_newton_per_m(),
                    event.payload.is_harder() ? "harder" : "softer",
                    event.payload.comment()->c_str());
        return true;
      });
  std::filesystem::remove(file);
  if (!read) return fail(read.error().text());
  std::printf("%d answers and %zu channels\n", count, (*reader)->channels().size());
  return 0;
}
