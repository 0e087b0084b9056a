#include <fcntl.h>
#include <gtest/gtest.h>
#include <io.h>
#include <windows.h>

#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include "rtpm/program/stop_signal.hpp"
#include "rtpm/program/terminal.hpp"

namespace rtpm::program {
namespace {

using namespace std::chrono_literals;

/// Asks this process to end, as another process would.
void request_stop() {
  const std::wstring name = L"Local\\rtpm-stop-" + std::to_wstring(GetCurrentProcessId());
  const HANDLE event = OpenEventW(EVENT_MODIFY_STATE, FALSE, name.c_str());
  ASSERT_NE(event, nullptr);
  SetEvent(event);
  CloseHandle(event);
}

TEST(StopEvent, IsNotSetByItselfThenWakesEveryWaiterAndStaysSet) {
  const StopSignal stop;
  const StopSignal display(LostOutput::kRequestsEnd);
  EXPECT_FALSE(stop.is_requested());
  EXPECT_FALSE(stop.wait_for(1ms));
  EXPECT_FALSE(stop.wait_for(-1s));
  std::thread first([&] { stop.wait(); });
  std::thread second([&] {
    while (!display.wait_for(10s)) {
    }
  });
  request_stop();
  first.join();
  second.join();
  stop.wait();
  EXPECT_TRUE(stop.is_requested());
  EXPECT_TRUE(stop.wait_for(0s));
  EXPECT_TRUE(display.is_requested());
}

TEST(StandardStreams, CarryBytesAsTheyAre) {
  EXPECT_EQ(_setmode(_fileno(stdout), _O_BINARY), _O_BINARY);
  EXPECT_EQ(_setmode(_fileno(stdin), _O_BINARY), _O_BINARY);
}

TEST(Programs, TakeTextsAsUtf8) {
  EXPECT_EQ(GetACP(), UINT{CP_UTF8});
}

TEST(TerminalWidth, IsTheDefaultForAFile) {
  if (_isatty(_fileno(stdout)) != 0) GTEST_SKIP() << "standard output is a terminal";
  EXPECT_EQ(terminal_width(77), 77u);
}

}  // namespace
}  // namespace rtpm::program
