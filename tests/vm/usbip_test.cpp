#include <gtest/gtest.h>
#include <libusb.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "guest.hpp"
#include "usbip_bridge.hpp"

/// The bridge itself: a USB device that sends back what it gets, through libusb.
namespace rtpm::vm_test {
namespace {

constexpr std::uint16_t kVendor = 0x1209;
constexpr std::uint16_t kProduct = 0x0002;
constexpr std::uint8_t kIn = 0x81;
constexpr std::uint8_t kOut = 0x02;
constexpr std::uint8_t kStallingOut = 0x03;
constexpr std::uint8_t kVendorToDevice = 0x40;
constexpr std::uint8_t kVendorToHost = 0xC0;
constexpr unsigned kPatienceMs = 10'000;

template <std::size_t Size>
std::array<std::byte, Size> bytes_of(const std::array<int, Size>& values) {
  std::array<std::byte, Size> bytes{};
  for (std::size_t i = 0; i < Size; ++i)
    bytes[i] = static_cast<std::byte>(values[i]);
  return bytes;
}

/// The packets that the device has received and not yet sent back.
struct Echo {
  std::deque<std::vector<std::byte>> packets{};
  std::uint16_t value = 0;
};

device_bridges::UsbModel model_of(Echo& echo) {
  device_bridges::UsbModel model;
  model.device_descriptor = bytes_of<18>(
      {18, 1, 0x00, 0x02, 0xFF, 0, 0, 64, 0x09, 0x12, 0x02, 0x00, 0x00, 0x01, 1, 2, 3, 1});
  const auto configuration = bytes_of<39>({9, 2,    39,
                                           0, 1,    1,
                                           0, 0x80, 50,  // One interface,
                                           9, 4,    0,
                                           0, 3,    0xFF,
                                           0, 0,    0,  // of three
                                           7, 5,    kIn,
                                           2, 64,   0,
                                           0,  // endpoints for
                                           7, 5,    kOut,
                                           2, 64,   0,
                                           0,  // transfers of
                                           7, 5,    kStallingOut,
                                           2, 64,   0,
                                           0});  // any size.
  model.configuration_descriptor.assign(configuration.begin(), configuration.end());
  model.strings = {"RTPM", "test echo", "echo-7"};
  model.on_control = [&echo](const device_bridges::UsbSetup& setup, std::span<const std::byte>) {
    if (setup.request == 9) return device_bridges::UsbAnswer{device_bridges::UsbStatus::kStall};
    if (setup.request_type == kVendorToDevice) echo.value = setup.value;
    return device_bridges::UsbAnswer{
        .data = {static_cast<std::byte>(echo.value), static_cast<std::byte>(echo.value >> 8U)}};
  };
  model.on_out = [&echo](std::uint8_t endpoint, std::span<const std::byte> data) {
    if (endpoint == kStallingOut)
      return device_bridges::UsbAnswer{device_bridges::UsbStatus::kStall};
    echo.packets.emplace_back(data.begin(), data.end());
    return device_bridges::UsbAnswer{};
  };
  model.on_in = [&echo](std::uint8_t, std::size_t, MonotonicTime) {
    if (echo.packets.empty())
      return device_bridges::UsbAnswer{device_bridges::UsbStatus::kNotReady};
    device_bridges::UsbAnswer answer{.data = echo.packets.front()};
    echo.packets.pop_front();
    return answer;
  };
  return model;
}

class Usbip : public testing::Test {
 protected:
  void SetUp() override {
    if (const std::string missing = missing_vhci(); !missing.empty()) GTEST_SKIP() << missing;
    const auto plugged = bridge_.plug();
    ASSERT_TRUE(plugged) << plugged.error().text();
    ASSERT_EQ(libusb_init(&context_), 0);
    ASSERT_TRUE(open());
  }
  void TearDown() override {
    close();
    if (context_ != nullptr) libusb_exit(context_);
  }
  [[nodiscard]] bool open() {
    return await([&] {
      device_ = libusb_open_device_with_vid_pid(context_, kVendor, kProduct);
      return device_ != nullptr && libusb_claim_interface(device_, 0) == 0;
    });
  }
  void close() {
    if (device_ != nullptr) libusb_close(device_);
    device_ = nullptr;
  }
  /// Sends or receives; returns libusb's error or the number of bytes.
  [[nodiscard]] int transfer(std::uint8_t endpoint, std::span<std::uint8_t> bytes,
                             unsigned patience_ms = kPatienceMs) const {
    int count = 0;
    const int error = libusb_bulk_transfer(device_, endpoint, bytes.data(),
                                           static_cast<int>(bytes.size()), &count, patience_ms);
    return error == 0 ? count : error;
  }

  Echo echo_{};
  device_bridges::UsbipBridge bridge_{model_of(echo_)};
  libusb_context* context_ = nullptr;
  libusb_device_handle* device_ = nullptr;
};

TEST_F(Usbip, SendsBackWhatItGetsInOrder) {
  for (std::uint8_t i = 0; i < 50; ++i) {
    std::array<std::uint8_t, 16> sent{};
    sent.fill(i);
    ASSERT_EQ(transfer(kOut, sent), 16);
    std::array<std::uint8_t, 64> received{};
    ASSERT_EQ(transfer(kIn, received), 16);
    ASSERT_TRUE(std::equal(sent.begin(), sent.end(), received.begin()));
  }
}

TEST_F(Usbip, AnswersVendorRequestsAndStrings) {
  ASSERT_EQ(
      libusb_control_transfer(device_, kVendorToDevice, 1, 0x4002, 0, nullptr, 0, kPatienceMs), 0);
  std::array<std::uint8_t, 2> value{};
  ASSERT_EQ(libusb_control_transfer(device_, kVendorToHost, 2, 0, 0, value.data(), 2, kPatienceMs),
            2);
  EXPECT_EQ(value, (std::array<std::uint8_t, 2>{0x02, 0x40}));
  std::array<unsigned char, 32> text{};
  ASSERT_EQ(libusb_get_string_descriptor_ascii(device_, 3, text.data(), text.size()), 6);
  EXPECT_EQ(std::string(text.begin(), text.begin() + 6), "echo-7");
}

TEST_F(Usbip, AStallIsAPipeError) {
  std::array<std::uint8_t, 1> byte{};
  EXPECT_EQ(transfer(kStallingOut, byte), LIBUSB_ERROR_PIPE);
  EXPECT_EQ(libusb_control_transfer(device_, kVendorToHost, 9, 0, 0, byte.data(), 1, kPatienceMs),
            LIBUSB_ERROR_PIPE);
}

TEST_F(Usbip, ATransferWithoutAnAnswerIsTakenBack) {
  std::array<std::uint8_t, 64> received{};
  EXPECT_EQ(transfer(kIn, received, 50), LIBUSB_ERROR_TIMEOUT);
  // The cancelled transfer has not swallowed the next packet.
  std::array<std::uint8_t, 3> sent{1, 2, 3};
  ASSERT_EQ(transfer(kOut, sent), 3);
  EXPECT_EQ(transfer(kIn, received), 3);
}

TEST_F(Usbip, AnUnpluggedDeviceIsGoneAndComesBack) {
  bridge_.unplug();
  std::array<std::uint8_t, 64> bytes{};
  EXPECT_TRUE(await([&] { return transfer(kIn, bytes, 100) == LIBUSB_ERROR_NO_DEVICE; }));
  close();
  ASSERT_TRUE(bridge_.plug());
  ASSERT_TRUE(open());
  ASSERT_EQ(transfer(kOut, std::span(bytes).first(5)), 5);
  EXPECT_EQ(transfer(kIn, bytes), 5);
}

}  // namespace
}  // namespace rtpm::vm_test
