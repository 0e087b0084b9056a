#include "player.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "clip.hpp"
#include "programs.hpp"
#include "rtpm/device_mpv/settings.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/test/os.hpp"

namespace rtpm::system_test {

std::string mpv_path() {
  const char* const path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (::access((folder + "/mpv").c_str(), X_OK) == 0) return folder + "/mpv";
  }
  return "";
}

device_mpv::Reply Observer::ask(std::string_view command,
                                std::initializer_list<device_mpv::Word> words) {
  EXPECT_TRUE(transport_->send(device_mpv::command_line(++id_, command, words)));
  std::optional<device_mpv::Reply> answer;
  const MonotonicTime end = rt::now() + kPatience;
  while (!answer && rt::now() < end) {
    std::array<char, 1024> buffer{};
    const auto received = transport_->receive(buffer, std::chrono::milliseconds{100});
    cutter_.push({buffer.data(), received.size}, [&](std::string_view line) {
      const auto message = device_mpv::parse(line);
      const auto* const reply = std::get_if<device_mpv::Reply>(&message);
      if (reply != nullptr && reply->request_id == id_) answer = *reply;
    });
    if (received.is_closed) break;
  }
  EXPECT_TRUE(answer) << "mpv does not answer to " << command;
  return answer.value_or(device_mpv::Reply{});
}

std::optional<double> Observer::shown_s() {
  const auto position_s = ask("get_property", {"time-pos"}).number;
  if (ask("get_property", {"seeking"}).flag.value_or(true)) return std::nullopt;
  return position_s;
}

bool Observer::await_shown(double position_s) {
  return test::await(
      [&] {
        const auto shown = shown_s();
        return shown && std::abs(*shown - position_s) < 0.02;
      },
      kPatience);
}

void WithMpv::SetUp() {
  if (mpv_path().empty()) GTEST_SKIP() << "mpv is not installed";
  std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
  clip_ = testing::TempDir() + "rtpm_" + name + ".y4m";
  socket_ = testing::TempDir() + "rtpm_" + name + ".socket";
  std::filesystem::remove(socket_);
  const auto written = media::write_clip(clip_);
  ASSERT_TRUE(written) << written.error().text();
}

void WithMpv::TearDown() {
  std::filesystem::remove(clip_);
  std::filesystem::remove(socket_);
}

void WithMpv::start_mpv() {
  mpv_.emplace(std::vector<std::string>{mpv_path(), "--no-config", "--no-terminal", "--vo=null",
                                        "--ao=null", "--pause", "--keep-open=yes", "--idle=yes",
                                        "--input-ipc-server=" + socket_, clip_});
  ASSERT_TRUE(test::await([&] { return device_mpv::open_mpv({.socket = socket_})().has_value(); },
                          kPatience));
  // mpv listens before it has loaded its file, and refuses to seek until then.
  Observer mpv = observe();
  ASSERT_TRUE(test::await(
      [&] { return mpv.ask("get_property", {"duration"}).number.value_or(0) > 0; }, kPatience));
}

Observer WithMpv::observe() const {
  return Observer(std::move(*device_mpv::open_mpv({.socket = socket_})()));
}

}  // namespace rtpm::system_test
