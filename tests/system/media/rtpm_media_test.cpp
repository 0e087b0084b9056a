#include <signal.h>

#include <cmath>
#include <string>
#include <vector>

#include "player.hpp"
#include "programs.hpp"
#include "rtpm/test/os.hpp"

/// rtpm-media with a simulated knob and the real mpv, each behind the network.
namespace rtpm::system_test {
namespace {

class Media : public WithMpv {
 protected:
  void SetUp() override {
    WithMpv::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    registry_ = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
    ASSERT_TRUE(registry_);
  }
  [[nodiscard]] std::optional<Daemon> host(const std::string& arguments) const {
    return start_daemon("rtpm-deviced",
                        {"--port", "0", "--registry", registry_->url, "--realtime", "off",
                         "--devices", "knob0,mpv0", "--device-mpv0-arguments", arguments});
  }
  [[nodiscard]] std::vector<std::string> media(std::vector<std::string> options) const {
    options.insert(options.end(),
                   {"--registry", registry_->url, "--player", "lab/mpv0", "--headless"});
    return options;
  }
  [[nodiscard]] test::Process start_media(std::vector<std::string> options) const {
    options.insert(options.begin(), {path_of("rtpm-media"), "--seconds", "0"});
    return test::Process(media(options));
  }
  /// Waits until the program prints all of `words`, and ends it; returns its output.
  static std::string end_after(const std::vector<std::string>& words, test::Process& program) {
    for (const std::string& word : words)
      EXPECT_TRUE(program.wait_for_output(word, kPatience)) << word << program.output();
    program.send_signal(SIGINT);
    const auto end = program.wait(kPatience);
    EXPECT_TRUE(end && end->exit_code == 0) << program.errors();
    return program.output();
  }

  std::optional<Daemon> registry_{};
};

TEST_F(Media, ScrubsAClipForwardsAndBackwards) {
  start_mpv();
  const auto devices = host("socket=" + socket_);
  ASSERT_TRUE(devices);
  Observer mpv = observe();
  test::Process program = start_media({"--mode", "scrub", "--fixed-mode"});
  double forwards_s = 0;
  double backwards_s = 0;
  double before_s = mpv.shown_s().value_or(0);
  EXPECT_TRUE(test::await([&] {
    const double shown_s = mpv.shown_s().value_or(before_s);
    (shown_s > before_s ? forwards_s : backwards_s) += std::abs(shown_s - before_s);
    before_s = shown_s;
    return forwards_s > 1 && backwards_s > 1;
  })) << forwards_s
      << " " << backwards_s;
  expect_text(end_after({"scrub ["}, program), {"followed "});
}

TEST_F(Media, ChangesItsModeByTheKnobsButton) {
  const auto devices = host("headless=yes file=" + clip_);
  ASSERT_TRUE(devices);
  test::Process program = start_media({});
  end_after({"speed [", "scrub ["}, program);
}

/// A player that only the plug-in makes a device: its server and its supplier of events.
TEST_F(Media, DrivesAPlayerThatHasTheDeviceInside) {
#ifndef RTPM_MPV_PLUGIN
  GTEST_SKIP() << "libmpv-dev is not installed, so that the plug-in was not built";
#else
  const auto devices =
      start_daemon("rtpm-deviced", {"--port", "0", "--registry", registry_->url, "--realtime",
                                    "off", "--devices", "knob0", "--serve-events"});
  ASSERT_TRUE(devices);
  // With --no-terminal, mpv would leave SIGTERM to the system, and not end in order.
  mpv_.emplace(std::vector<std::string>{
      mpv_path(), "--no-config", "--quiet", "--vo=null", "--ao=null", "--idle=yes", "--pause",
      "--keep-open=yes", "--script=" RTPM_MPV_PLUGIN,
      "--script-opts=rtpm-name=lab/mpv0,rtpm-registry=" + registry_->url, clip_});
  ASSERT_TRUE(mpv_->wait_for_output("serving lab/mpv0 at ", kPatience)) << mpv_->errors();
  test::Process program = start_media({"--mode", "scrub", "--fixed-mode"});
  end_after({"scrub [=="}, program);
  const auto shown =
      run_program("rtpm-display", {"--registry", registry_->url, "--devices", "lab/mpv0",
                                   "--seconds", "1.5", "--live", "lines"});
  EXPECT_NE(shown.output.find("position"), std::string::npos) << shown.output << shown.errors;
  mpv_->send_signal(SIGTERM);
  const auto ended = mpv_->wait(kPatience);
  ASSERT_TRUE(ended) << "the plug-in ends with its player";
  EXPECT_TRUE(ended->exit_code) << "in order, and not by a crash";
#endif
}

TEST_F(Media, EndsWithASentenceWhenSomethingIsMissing) {
  const auto devices = host("headless=yes file=" + clip_);
  ASSERT_TRUE(devices);
  expect_one_sentence(run_program("rtpm-media", media({"--knob", "lab/mpv0"})), 1,
                      {"lab/mpv0", "--knob"});
  expect_one_sentence(run_program("rtpm-media", {"--registry", registry_->url, "--player",
                                                 "lab/nobody", "--headless"}),
                      1, {"lab/nobody"});
  expect_one_sentence(run_program("rtpm-media", {"--make-clip", "/no/such/folder/clip.y4m"}), 1,
                      {"/no/such/folder/clip.y4m"});
  EXPECT_EQ(run_program("rtpm-media", {"--mode", "dance"}).exit_code, 2);
}

TEST_F(Media, RefusesAPlayerWithoutItsOptions) {
  const auto end = run_program("rtpm-deviced", {"--port", "0", "--registry", registry_->url,
                                                "--realtime", "off", "--devices", "mpv0"});
  expect_one_sentence(end, 1, {"file=CLIP", "socket=PATH"});
}

}  // namespace
}  // namespace rtpm::system_test
