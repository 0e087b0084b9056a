#include "usb_transport.hpp"

#include <libusb.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>
#include <utility>

#include "rtpm/device_io/found_device.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::device_falcon {
namespace {

constexpr int kInterface = 0;
constexpr unsigned kRequestMilliseconds = 100;
constexpr int kPortDepthMax = 7;
/// How long the destructor waits for the transfers that it cancels.
constexpr Duration kCancelPatience = std::chrono::seconds{1};

struct ContextEnd {
  void operator()(libusb_context* context) const { libusb_exit(context); }
};
using Context = std::unique_ptr<libusb_context, ContextEnd>;
struct HandleEnd {
  void operator()(libusb_device_handle* handle) const { libusb_close(handle); }
};
using Handle = std::unique_ptr<libusb_device_handle, HandleEnd>;
struct TransferEnd {
  void operator()(libusb_transfer* transfer) const { libusb_free_transfer(transfer); }
};
using Transfer = std::unique_ptr<libusb_transfer, TransferEnd>;

expected<Context, SetupError> make_context() {
  libusb_context* context = nullptr;
  if (const int error = libusb_init(&context); error != LIBUSB_SUCCESS) {
    return setup_error("libusb does not start", libusb_strerror(error),
                       "check that this machine, or container, has /dev/bus/usb");
  }
  libusb_set_option(context, LIBUSB_OPTION_LOG_LEVEL, LIBUSB_LOG_LEVEL_NONE);
  return Context(context);
}

/// The device list of a context, with a reference to each device.
class Devices {
 public:
  explicit Devices(libusb_context* context) {
    if (const auto size = libusb_get_device_list(context, &list_); size > 0) {
      size_ = static_cast<std::size_t>(size);
    }
  }
  Devices(const Devices&) = delete;
  Devices& operator=(const Devices&) = delete;
  ~Devices() {
    if (list_ != nullptr) libusb_free_device_list(list_, 1);
  }
  [[nodiscard]] std::span<libusb_device* const> all() const { return {list_, size_}; }

 private:
  libusb_device** list_ = nullptr;
  std::size_t size_ = 0;
};

bool is_falcon(libusb_device* device) {
  libusb_device_descriptor descriptor{};
  return libusb_get_device_descriptor(device, &descriptor) == LIBUSB_SUCCESS &&
         descriptor.idVendor == kVendor && descriptor.idProduct == kProduct;
}

std::string port_of(libusb_device* device) {
  std::array<std::uint8_t, kPortDepthMax> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), kPortDepthMax);
  std::string name = std::to_string(libusb_get_bus_number(device));
  char separator = '-';
  for (int i = 0; i < depth; ++i) {
    name += separator + std::to_string(ports[static_cast<std::size_t>(i)]);
    separator = '.';
  }
  return name;
}

std::string node_of(libusb_device* device) {
  std::array<char, 32> name{};
  std::snprintf(name.data(), name.size(), "/dev/bus/usb/%03u/%03u",
                unsigned{libusb_get_bus_number(device)},
                unsigned{libusb_get_device_address(device)});
  return name.data();
}

/// Reads the kernel's copy, because querying the device would need a permission.
std::string serial_at(const std::string& port) {
  std::ifstream file("/sys/bus/usb/devices/" + port + "/serial");
  std::string serial;
  std::getline(file, serial);
  return serial;
}

UsbStatus status_of(int error) {
  switch (error) {
    case LIBUSB_SUCCESS:
      return UsbStatus::kOk;
    case LIBUSB_ERROR_TIMEOUT:
      return UsbStatus::kTimeout;
    case LIBUSB_ERROR_PIPE:
      return UsbStatus::kStalled;
    case LIBUSB_ERROR_OVERFLOW:
      return UsbStatus::kOverflow;
    default:
      return UsbStatus::kGone;
  }
}

UsbStatus status_of(const libusb_transfer& transfer) {
  switch (transfer.status) {
    case LIBUSB_TRANSFER_COMPLETED:
      return UsbStatus::kOk;
    case LIBUSB_TRANSFER_STALL:
      return UsbStatus::kStalled;
    case LIBUSB_TRANSFER_OVERFLOW:
      return UsbStatus::kOverflow;
    default:
      return UsbStatus::kGone;
  }
}

class UsbTransport final : public Transport {
 public:
  UsbTransport(Context context, Handle handle)
      : context_(std::move(context)), handle_(std::move(handle)) {}
  ~UsbTransport() override;

  /// Allocates and starts all transfers.
  /// @errors   no memory, or the device refuses
  [[nodiscard]] expected<void, SetupError> begin();

  [[nodiscard]] UsbStatus request(FtdiRequest request, std::uint16_t value) override;
  [[nodiscard]] UsbStatus send(std::span<const std::byte> bytes) override;
  [[nodiscard]] Received receive(std::span<std::byte> buffer, Duration patience) override;
  [[nodiscard]] MonotonicTime now() const override { return rt::now(); }

 private:
  static constexpr std::size_t kInCount = 4;
  static constexpr std::size_t kSlotCount = 16;
  struct Slot {
    Received received{};
    std::array<std::byte, kTransferSize> bytes{};
  };
  struct InTransfer {
    UsbTransport* owner = nullptr;
    Transfer transfer{};
    std::size_t slot = 0;
    bool is_under_way = false;
  };

  static void LIBUSB_CALL on_in(libusb_transfer* transfer);
  static void LIBUSB_CALL on_out(libusb_transfer* transfer);
  void submit(InTransfer& in);
  void take(InTransfer& in);
  void end_stall();
  void handle_events(Duration patience);
  [[nodiscard]] bool is_any_under_way() const;

  Context context_;
  Handle handle_;
  std::array<Slot, kSlotCount> slots_{};
  std::array<InTransfer, kInCount> ins_{};
  Transfer out_{};
  std::array<std::byte, kTransferSize> out_bytes_{};
  bool is_out_under_way_ = false;
  /// First the slots with data, oldest first, then the empty slots that no transfer uses.
  std::array<std::size_t, kSlotCount - kInCount> order_{};
  std::size_t ready_count_ = 0;
  UsbStatus failure_ = UsbStatus::kOk;
};

unsigned char* as_chars(std::byte* bytes) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): bytes for a library in C
  return reinterpret_cast<unsigned char*>(bytes);
}

expected<void, SetupError> UsbTransport::begin() {
  out_.reset(libusb_alloc_transfer(0));
  bool has_all = out_ != nullptr;
  for (std::size_t i = 0; i < kInCount; ++i) {
    ins_[i].owner = this;
    ins_[i].slot = i;
    ins_[i].transfer.reset(libusb_alloc_transfer(0));
    has_all = has_all && ins_[i].transfer != nullptr;
  }
  for (std::size_t i = 0; i < order_.size(); ++i)
    order_[i] = kInCount + i;
  if (!has_all) return setup_error("libusb has no memory for its transfers");
  for (InTransfer& in : ins_) {
    libusb_fill_bulk_transfer(in.transfer.get(), handle_.get(), kEndpointIn, nullptr,
                              static_cast<int>(kTransferSize), on_in, &in, 0);
    submit(in);
  }
  if (failure_ != UsbStatus::kOk) {
    return setup_error("the Falcon takes no transfers", "", "unplug it and plug it in again");
  }
  return {};
}

UsbTransport::~UsbTransport() {
  for (InTransfer& in : ins_) {
    if (in.is_under_way) libusb_cancel_transfer(in.transfer.get());
  }
  if (is_out_under_way_) libusb_cancel_transfer(out_.get());
  const MonotonicTime end = now() + kCancelPatience;
  while (is_any_under_way() && now() < end)
    handle_events(std::chrono::milliseconds{10});
  if (failure_ == UsbStatus::kStalled) {
    libusb_clear_halt(handle_.get(), kEndpointIn);
    libusb_clear_halt(handle_.get(), kEndpointOut);
  }
  libusb_release_interface(handle_.get(), kInterface);
  // Closed before its transfers are freed: libusb releases the transfers that have not ended.
  handle_.reset();
}

bool UsbTransport::is_any_under_way() const {
  return is_out_under_way_ ||
         std::ranges::any_of(ins_, [](const InTransfer& in) { return in.is_under_way; });
}

void UsbTransport::submit(InTransfer& in) {
  in.transfer->buffer = as_chars(slots_[in.slot].bytes.data());
  const int error = libusb_submit_transfer(in.transfer.get());
  in.is_under_way = error == LIBUSB_SUCCESS;
  if (!in.is_under_way) failure_ = status_of(error);
}

void UsbTransport::on_in(libusb_transfer* transfer) {
  InTransfer& in = *static_cast<InTransfer*>(transfer->user_data);
  in.is_under_way = false;
  if (transfer->status == LIBUSB_TRANSFER_CANCELLED) return;
  const UsbStatus status = status_of(*transfer);
  if (status == UsbStatus::kOk || status == UsbStatus::kOverflow) {
    in.owner->take(in);
  } else {
    in.owner->failure_ = status;
  }
}

/// Gives the transfer another slot and submits it, then queues the received data. If the queue is
/// full, its oldest transfer is dropped.
void UsbTransport::take(InTransfer& in) {
  const std::size_t filled = in.slot;
  Slot& slot = slots_[filled];
  slot.received = {status_of(*in.transfer), static_cast<std::size_t>(in.transfer->actual_length),
                   rt::now()};
  if (ready_count_ == order_.size()) {
    std::rotate(order_.begin(), order_.begin() + 1, order_.end());
    --ready_count_;
  }
  in.slot = std::exchange(order_[ready_count_++], filled);
  submit(in);
}

void UsbTransport::on_out(libusb_transfer* transfer) {
  UsbTransport& owner = *static_cast<UsbTransport*>(transfer->user_data);
  owner.is_out_under_way_ = false;
  if (transfer->status == LIBUSB_TRANSFER_CANCELLED) return;
  if (const UsbStatus status = status_of(*transfer); status != UsbStatus::kOk) {
    owner.failure_ = status;
  }
}

void UsbTransport::handle_events(Duration patience) {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(patience).count();
  timeval time{.tv_sec = us / 1'000'000, .tv_usec = us % 1'000'000};
  // An error inside libusb appears to the caller as a time-out.
  libusb_handle_events_timeout_completed(context_.get(), &time, nullptr);
}

/// An endpoint stays stalled until the host clears it. Set-up only: libusb waits for the device.
void UsbTransport::end_stall() {
  libusb_clear_halt(handle_.get(), kEndpointIn);
  libusb_clear_halt(handle_.get(), kEndpointOut);
  failure_ = UsbStatus::kOk;
  for (InTransfer& in : ins_) {
    if (!in.is_under_way) submit(in);
  }
}

UsbStatus UsbTransport::request(FtdiRequest request, std::uint16_t value) {
  if (failure_ == UsbStatus::kStalled) end_stall();
  if (failure_ != UsbStatus::kOk) return failure_;
  return status_of(libusb_control_transfer(handle_.get(), kVendorRequestType,
                                           static_cast<std::uint8_t>(request), value, kInterface,
                                           nullptr, 0, kRequestMilliseconds));
}

UsbStatus UsbTransport::send(std::span<const std::byte> bytes) {
  if (failure_ != UsbStatus::kOk) return failure_;
  if (is_out_under_way_) handle_events(Duration{0});
  if (is_out_under_way_) return UsbStatus::kBusy;
  const std::size_t size = std::min(bytes.size(), out_bytes_.size());
  std::copy_n(bytes.begin(), size, out_bytes_.begin());
  libusb_fill_bulk_transfer(out_.get(), handle_.get(), kEndpointOut, as_chars(out_bytes_.data()),
                            static_cast<int>(size), on_out, this, 0);
  const UsbStatus status = status_of(libusb_submit_transfer(out_.get()));
  is_out_under_way_ = status == UsbStatus::kOk;
  return status;
}

Received UsbTransport::receive(std::span<std::byte> buffer, Duration patience) {
  const MonotonicTime end = now() + patience;
  while (ready_count_ == 0) {
    const MonotonicTime at = now();
    if (failure_ != UsbStatus::kOk) return {failure_, 0, at};
    if (at > end) return {UsbStatus::kTimeout, 0, at};
    handle_events(end - at);
  }
  const Slot& slot = slots_[order_[0]];
  Received received = slot.received;
  received.size = std::min(received.size, buffer.size());
  std::copy_n(slot.bytes.begin(), received.size, buffer.begin());
  std::rotate(order_.begin(), order_.begin() + 1, order_.end());
  --ready_count_;
  return received;
}

unexpected<SetupError> open_error(const Unit& unit, int error) {
  const std::string what = "the Falcon at the port " + unit.port + " can't be opened";
  if (error == LIBUSB_ERROR_ACCESS) {
    return setup_error(what, "this user lacks the right of " + device_io::missing_right(unit.node),
                       device_io::rule_remedy(device_io::udev_rule("usb", kVendor, kProduct)));
  }
  if (error == LIBUSB_ERROR_BUSY) {
    return setup_error(what, "another program uses it", "end that program");
  }
  return setup_error(what, libusb_strerror(error), "unplug it and plug it in again");
}

}  // namespace

expected<std::vector<Unit>, SetupError> find_units() {
  auto context = make_context();
  if (!context) return unexpected{context.error()};
  std::vector<Unit> units;
  const Devices devices(context->get());
  for (libusb_device* const device : devices.all()) {
    if (!is_falcon(device)) continue;
    const std::string port = port_of(device);
    units.push_back({.serial = serial_at(port), .port = port, .node = node_of(device)});
  }
  return units;
}

expected<std::unique_ptr<Transport>, SetupError> open_usb(const Unit& unit) {
  auto context = make_context();
  if (!context) return unexpected{context.error()};
  const Devices devices(context->get());
  const auto found = std::ranges::find_if(devices.all(), [&](libusb_device* device) {
    return is_falcon(device) && node_of(device) == unit.node;
  });
  if (found == devices.all().end()) return open_error(unit, LIBUSB_ERROR_NO_DEVICE);
  libusb_device_handle* opened = nullptr;
  if (const int error = libusb_open(*found, &opened); error != LIBUSB_SUCCESS) {
    return open_error(unit, error);
  }
  Handle handle(opened);
  libusb_set_auto_detach_kernel_driver(opened, 1);
  if (const int error = libusb_claim_interface(opened, kInterface); error != LIBUSB_SUCCESS) {
    return open_error(unit, error);
  }
  auto transport = std::make_unique<UsbTransport>(std::move(*context), std::move(handle));
  if (auto begun = transport->begin(); !begun) return unexpected{begun.error()};
  return transport;
}

}  // namespace rtpm::device_falcon
