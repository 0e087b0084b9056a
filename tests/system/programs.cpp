#include "programs.hpp"

#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

namespace rtpm::system_test {
namespace {

std::vector<std::string> command_of(std::string_view program, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), path_of(program));
  return arguments;
}

}  // namespace

std::string path_of(std::string_view program) {
  if (const char* const others = std::getenv(kOtherSystems); others != nullptr) {
    const std::string other = std::string(others) + "/" + std::string(program);
    if (std::filesystem::exists(other)) return other;
  }
  return std::string(RTPM_PROGRAM_FOLDER) + "/" + std::string(program);
}

std::uint16_t Daemon::port() const {
  const std::size_t end = url.find('/', url.find("//") + 2);
  return static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':', end) + 1)));
}

std::optional<Daemon> start_daemon(std::string_view program, std::vector<std::string> arguments,
                                   const std::vector<std::string>& before) {
  std::vector<std::string> command = command_of(program, std::move(arguments));
  command.insert(command.begin(), before.begin(), before.end());
  return start_daemon(std::move(command));
}

std::optional<Daemon> start_daemon(std::vector<std::string> command) {
  test::Process process(command);
  if (!process.wait_for_output("rtpm://", kPatience) || !process.wait_for_output("\n", kPatience)) {
    ADD_FAILURE() << testing::PrintToString(command) << " does not serve: " << process.output()
                  << process.errors();
    return std::nullopt;
  }
  const std::string& output = process.output();
  const std::size_t begin = output.find("rtpm://");
  const std::string url = output.substr(begin, output.find_first_of(" \n", begin) - begin);
  return Daemon{std::move(process), url};
}

test::Process::End run_program(std::string_view program, std::vector<std::string> arguments) {
  auto end = test::run(command_of(program, std::move(arguments)), kPatience);
  if (end) return std::move(*end);
  ADD_FAILURE() << program << " did not end";
  return {};
}

void expect_one_sentence(const test::Process::End& end, int exit_code,
                         const std::vector<std::string_view>& words) {
  EXPECT_EQ(end.exit_code, exit_code) << end.output << end.errors;
  EXPECT_EQ(test::line_count(end.errors), 1) << end.errors;
  expect_text(end.errors, {words.begin(), words.end()});
}

void WithRegistry::SetUp() {
  registry_ = start_daemon("rtpm-registryd", {"--port", "0", "--realtime", "off"});
  ASSERT_TRUE(registry_);
}

std::optional<Daemon> WithRegistry::start_server(std::string_view program,
                                                 std::vector<std::string> options) const {
  if (std::ranges::find(options, "--port") == options.end())
    options.insert(options.end(), {"--port", "0"});
  options.insert(options.end(), {"--registry", registry_->url, "--realtime", "off"});
  return start_daemon(program, std::move(options));
}

test::Process::End WithRegistry::rtpm(std::vector<std::string> arguments) const {
  arguments.insert(arguments.end(), {"--registry", registry_->url, "--deadline", "10s"});
  return run_program("rtpm", std::move(arguments));
}

void Laboratory::SetUp() {
  WithRegistry::SetUp();
  device_ = start_server("rtpm-deviced");
  ASSERT_TRUE(device_);
}

test::Process::End Laboratory::run_servo(std::vector<std::string> arguments) const {
  const std::vector<std::string> common{"--registry", registry_->url, "--live",
                                        "off",        "--realtime",   "off"};
  arguments.insert(arguments.begin(), common.begin(), common.end());
  return run_program("rtpm-servo", std::move(arguments));
}

test::Process::End Laboratory::run_servo_until_it_succeeds() const {
  const auto give_up = std::chrono::steady_clock::now() + kPatience;
  test::Process::End end;
  do {
    end = run_servo({"--seconds", "0.2"});
  } while (end.exit_code != 0 && std::chrono::steady_clock::now() < give_up);
  return end;
}

std::optional<test::Process> Laboratory::start_servo(int seconds) const {
  test::Process servo({path_of("rtpm-servo"), "--registry", registry_->url, "--realtime", "off",
                       "--live", "lines", "--seconds", std::to_string(seconds)});
  // The first live line shows that the loop runs.
  if (servo.wait_for_output("\n", kPatience)) return servo;
  ADD_FAILURE() << "rtpm-servo does not run: " << servo.errors();
  return std::nullopt;
}

}  // namespace rtpm::system_test
