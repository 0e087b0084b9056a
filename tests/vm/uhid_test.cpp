#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/hidraw.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "guest.hpp"
#include "uhid_bridge.hpp"

/// The bridge itself: a HID device of a few bytes, over hidraw.
namespace rtpm::vm_test {
namespace {

constexpr std::uint8_t kInputNumber = 1;
constexpr std::uint8_t kOutputNumber = 2;
constexpr std::uint8_t kFeatureNumber = 3;
constexpr std::size_t kReportSize = 4;

/// Three reports of three vendor-defined bytes each: input 1, output 2, feature 3.
std::vector<std::byte> vendor_descriptor() {
  constexpr std::array<std::uint8_t, 40> kBytes{
      0x06, 0x00,           0xFF, 0x09, 0x01, 0xA1, 0x01,  // Usage page FF00, usage 1, collection.
      0x15, 0x00,           0x26, 0xFF, 0x00, 0x75, 0x08, 0x95, 0x03,  // Three bytes of 0..255.
      0x85, kInputNumber,   0x09, 0x02, 0x81, 0x02,                    //
      0x85, kOutputNumber,  0x09, 0x03, 0x91, 0x02,                    //
      0x85, kFeatureNumber, 0x09, 0x04, 0xB1, 0x02,                    //
      0xC0};
  std::vector<std::byte> bytes;
  for (const std::uint8_t byte : kBytes)
    bytes.push_back(std::byte{byte});
  while (bytes.back() != std::byte{0xC0})
    bytes.pop_back();
  return bytes;
}

/// A counter that counts its reports, echoes the output in them, and keeps a feature.
struct Counter {
  std::uint8_t count = 0;
  std::byte output{};
  std::vector<std::byte> feature{std::byte{kFeatureNumber}, std::byte{1}, std::byte{2},
                                 std::byte{3}};
};

device_bridges::HidModel model_of(Counter& counter, const std::string& serial_number) {
  device_bridges::HidModel model;
  model.identity = {.vendor = 0x1209,
                    .product = 0x0001,
                    .version = 1,
                    .name = "RTPM test counter",
                    .serial_number = serial_number};
  model.report_descriptor = vendor_descriptor();
  model.next_input_report = [&counter](MonotonicTime) {
    return std::vector<std::byte>{std::byte{kInputNumber}, std::byte{++counter.count},
                                  counter.output, std::byte{0x55}};
  };
  model.on_output_report = [&counter](std::span<const std::byte> report) {
    if (report.size() == kReportSize && report[0] == std::byte{kOutputNumber}) {
      counter.output = report[1];
    }
  };
  model.on_get_feature_report = [&counter](std::uint8_t number) {
    return number == kFeatureNumber ? counter.feature : std::vector<std::byte>{};
  };
  model.on_set_feature_report = [&counter](std::span<const std::byte> report) {
    counter.feature.assign(report.begin(), report.end());
    return report.size() == kReportSize;
  };
  return model;
}

using Report = std::array<std::uint8_t, kReportSize>;

/// An open hidraw node.
class Node {
 public:
  explicit Node(const std::string& path) : handle_(::open(path.c_str(), O_RDWR | O_CLOEXEC)) {}
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node() {
    if (handle_ >= 0) ::close(handle_);
  }
  [[nodiscard]] bool is_open() const { return handle_ >= 0; }
  [[nodiscard]] int handle() const { return handle_; }

  /// The next report; empty if none comes, or the device is gone.
  [[nodiscard]] std::optional<Report> read() const {
    pollfd entry{.fd = handle_, .events = POLLIN, .revents = 0};
    const auto patience = std::chrono::duration_cast<std::chrono::milliseconds>(kPatience);
    if (::poll(&entry, 1, static_cast<int>(patience.count())) <= 0) return std::nullopt;
    Report report{};
    const ssize_t count = ::read(handle_, report.data(), report.size());
    return count == static_cast<ssize_t>(report.size()) ? std::optional(report) : std::nullopt;
  }

 private:
  int handle_;
};

class Uhid : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string missing = missing_uhid(); !missing.empty()) GTEST_SKIP() << missing;
    const auto plugged = bridge_.plug();
    ASSERT_TRUE(plugged) << plugged.error().text();
    node_ = wait_for_hidraw_node("counter-7");
    ASSERT_FALSE(node_.empty()) << "hidraw does not show the device";
  }

  Counter counter_{};
  device_bridges::UhidBridge bridge_{model_of(counter_, "counter-7")};
  std::string node_{};
};

TEST_F(Uhid, InputReportsArriveInOrder) {
  const Node node(node_);
  ASSERT_TRUE(node.is_open());
  const auto first = node.read();
  ASSERT_TRUE(first);
  for (std::uint8_t i = 1; i < 100; ++i) {
    const auto next = node.read();
    ASSERT_TRUE(next);
    ASSERT_EQ(*next, (Report{kInputNumber, static_cast<std::uint8_t>((*first)[1] + i), 0, 0x55}));
  }
}

TEST_F(Uhid, OutputReportsReachTheModelAndItsAnswerTheReader) {
  const Node node(node_);
  constexpr Report kOutput{kOutputNumber, 0x42, 0, 0};
  ASSERT_EQ(::write(node.handle(), kOutput.data(), kOutput.size()),
            static_cast<ssize_t>(kOutput.size()));
  ASSERT_TRUE(await([&] {
    const auto report = node.read();
    return report && (*report)[2] == 0x42;
  }));
}

TEST_F(Uhid, FeatureReportsAreReadAndWritten) {
  const Node node(node_);
  Report feature{kFeatureNumber};
  ASSERT_EQ(::ioctl(node.handle(), HIDIOCGFEATURE(kReportSize), feature.data()), 4);
  EXPECT_EQ(feature, (Report{kFeatureNumber, 1, 2, 3}));
  Report changed{kFeatureNumber, 7, 8, 9};
  ASSERT_EQ(::ioctl(node.handle(), HIDIOCSFEATURE(kReportSize), changed.data()), 4);
  ASSERT_EQ(::ioctl(node.handle(), HIDIOCGFEATURE(kReportSize), feature.data()), 4);
  EXPECT_EQ(feature, changed);
}

TEST_F(Uhid, AnUnpluggedDeviceIsGoneAndComesBack) {
  {
    const Node node(node_);
    ASSERT_TRUE(node.read());
    bridge_.unplug();
    // Reports that had arrived are still read; then the node reports that it is gone.
    ASSERT_TRUE(await([&] { return !node.read(); }));
    constexpr Report kOutput{kOutputNumber, 1, 0, 0};
    EXPECT_LT(::write(node.handle(), kOutput.data(), kOutput.size()), 0);
    EXPECT_EQ(errno, ENODEV);
  }
  EXPECT_EQ(hidraw_node("counter-7"), "");
  ASSERT_TRUE(bridge_.plug());
  const Node again(wait_for_hidraw_node("counter-7"));
  ASSERT_TRUE(again.is_open());
  EXPECT_TRUE(again.read());
}

}  // namespace
}  // namespace rtpm::vm_test
