#include <hidapi/hidapi.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "node.hpp"
#include "report.hpp"
#include "rtpm/device_hid/transport.hpp"
#include "rtpm/device_io/found_device.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::device_hid {
namespace {

struct CloseDevice {
  void operator()(hid_device* device) const noexcept { hid_close(device); }
};
using DeviceHandle = std::unique_ptr<hid_device, CloseDevice>;

// NOLINTBEGIN(cppcoreguidelines-pro-type-reinterpret-cast): hidapi's bytes are unsigned char
unsigned char* raw(MutableBytes bytes) {
  return reinterpret_cast<unsigned char*>(bytes.data());
}
const unsigned char* raw(ConstBytes bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}
// NOLINTEND(cppcoreguidelines-pro-type-reinterpret-cast)

/// Converts the device's text to ASCII; other characters become '?'.
std::string narrow(const wchar_t* text) {
  std::string narrowed;
  for (; text != nullptr && *text != 0; ++text)
    narrowed += *text >= ' ' && *text <= '~' ? static_cast<char>(*text) : '?';
  return narrowed;
}

/// hidapi stores the last error in its handle without a lock, so reading and writing use one handle
/// each.
class HidapiTransport final : public HidTransport {
 public:
  HidapiTransport(DeviceHandle reading, DeviceHandle writing, const ReportSizes& sizes)
      : reading_(std::move(reading)), writing_(std::move(writing)), sizes_(sizes) {}

  [[nodiscard]] Received read(MutableBytes buffer, Duration patience) override {
    const auto wait_ms = std::chrono::ceil<std::chrono::milliseconds>(patience).count();
    const int size = hid_read_timeout(reading_.get(), raw(buffer), buffer.size(),
                                      static_cast<int>(std::max<std::int64_t>(wait_ms, 0)));
    if (size < 0) return {0, true};
    if (size == 0) return {};
    const std::size_t size_max = sizes_.inputs[byte_at(buffer, 0)];
    const auto received = static_cast<std::size_t>(size);
    return {size_max > 0 ? std::min(received, size_max) : received, false};
  }
  [[nodiscard]] bool write(ConstBytes report) override {
    const std::size_t size = std::min(report.size(), sizes_.output_max);
    if (hid_write(writing_.get(), raw(report), size) >= 0) return true;
    // hidapi up to 0.14 also returns -1, without an error, for a report that Windows wrote at once.
    return narrow(hid_error(writing_.get())) == "Success";
  }
  [[nodiscard]] std::size_t read_feature(MutableBytes report) override {
    std::vector<std::byte> buffer(report.begin(), report.end());
    buffer.resize(std::max(buffer.size(), sizes_.feature_min));
    const int size =
        hid_get_feature_report(writing_.get(), raw(MutableBytes(buffer)), buffer.size());
    const std::size_t received =
        std::min(static_cast<std::size_t>(std::max(size, 0)), report.size());
    std::ranges::copy(ConstBytes(buffer).first(received), report.begin());
    return received;
  }
  [[nodiscard]] MonotonicTime now() const override { return rt::now(); }

 private:
  DeviceHandle reading_;
  DeviceHandle writing_;
  ReportSizes sizes_;
};

Bus bus_of(hid_bus_type type) noexcept {
  if (type == HID_API_BUS_USB) return Bus::kUsb;
  return type == HID_API_BUS_BLUETOOTH ? Bus::kBluetooth : Bus::kOther;
}

class HidapiSystem final : public HidSystem {
 public:
  HidapiSystem() { static_cast<void>(hid_init()); }

  [[nodiscard]] std::vector<Unit> units() override {
    const std::unique_ptr<hid_device_info, decltype(&hid_free_enumeration)> first(
        hid_enumerate(0, 0), &hid_free_enumeration);
    std::vector<Unit> found;
    for (const auto* info = first.get(); info != nullptr; info = info->next) {
      const std::string node = info->path != nullptr ? info->path : "";
      // On Linux, hidapi lists a device once for each of its top-level collections. On Windows, each
      // of these has a node, and is a unit.
      if (node.empty() || std::ranges::count(found, node, &Unit::node) > 0) continue;
      const std::string maker = narrow(info->manufacturer_string);
      const std::string product = narrow(info->product_string);
      found.push_back({.vendor = info->vendor_id,
                       .product = info->product_id,
                       .bus = bus_of(info->bus_type),
                       .model = maker.empty() ? product : maker + " " + product,
                       .serial = narrow(info->serial_number),
                       .port = port_of(node),
                       .node = node,
                       .report_descriptor = report_descriptor_of(node)});
    }
    return found;
  }

  [[nodiscard]] expected<std::unique_ptr<HidTransport>, SetupError> open(
      const Unit& unit) override {
    // Where another program holds a device, hidapi opens it on Windows for neither reading nor writing.
    if (const std::string missing = device_io::missing_right(unit.node); !missing.empty()) {
      const std::string rule = device_io::udev_rule("hidraw", unit.vendor, unit.product);
      return setup_error(unit.node + " can't be opened", "this needs " + missing,
                         device_io::rule_remedy(rule));
    }
    DeviceHandle reading(hid_open_path(unit.node.c_str()));
    DeviceHandle writing(reading ? hid_open_path(unit.node.c_str()) : nullptr);
    if (!writing) return setup_error(unit.node + " can't be opened", narrow(hid_error({})));
    return std::unique_ptr<HidTransport>(std::make_unique<HidapiTransport>(
        std::move(reading), std::move(writing), report_sizes_of(unit)));
  }
};

}  // namespace

std::unique_ptr<HidSystem> make_hid_system() {
  return std::make_unique<HidapiSystem>();
}

}  // namespace rtpm::device_hid
