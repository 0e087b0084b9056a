#include "flight_files.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <system_error>
#include <utility>

#include "flight_format.hpp"
#include "rtpm/rt/clock.hpp"

namespace rtpm::deviced {
namespace {

constexpr Duration kInterval = std::chrono::milliseconds{100};

}  // namespace

FlightFiles::~FlightFiles() {
  is_stopping_.store(true, std::memory_order_relaxed);
  if (thread_.is_running()) thread_.join();
}

expected<void, SetupError> FlightFiles::start() {
  if (folder_.empty()) return {};
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error) {
    return setup_error("the folder of flight records, " + folder_ + ", can't be made",
                       error.message(), "set --flight-records to a folder that can be written");
  }
  for (Device& device : devices_)
    find_last_file(device);
  rt::ThreadConfig config;
  config.name = "flight-files";
  auto started = rt::Thread::start(config, [this] { loop(); });
  if (!started) return unexpected{std::move(started.error())};
  thread_ = std::move(*started);
  return {};
}

void FlightFiles::loop() {
  while (!is_stopping_.load(std::memory_order_relaxed)) {
    for (Device& device : devices_)
      write_new(device);
    rt::sleep_until(rt::now() + kInterval);
  }
  for (Device& device : devices_)
    write_new(device);
}

void FlightFiles::write_new(Device& device) {
  if (device.recorder->number() == device.written_number) return;
  const gvd::FlightLog log = device.recorder->newest();
  device.written_number = log.number;
  device.last_file = (device.last_file + 1) % kFileCountMax;
  const std::string path = path_of(device, device.last_file);
  const std::string cause(to_string(log.cause));
  if (const auto written = write_flight(path, device.name, log); !written) {
    log_.write(device.name + ": " + cause + " in cycle " + std::to_string(log.cycle) +
               "; its flight record was not written: " + written.error().text());
    return;
  }
  log_.write(device.name + ": " + cause + " in cycle " + std::to_string(log.cycle) +
             "; its flight record is " + path);
}

std::string FlightFiles::path_of(const Device& device, std::uint64_t file) const {
  std::string name = device.name;
  std::ranges::replace(name, '/', '-');
  return folder_ + "/" + name + "." + std::to_string(file) + std::string(flight_file_ending());
}

void FlightFiles::find_last_file(Device& device) const {
  auto newest = std::filesystem::file_time_type::min();
  for (std::uint64_t file = 0; file < kFileCountMax; ++file) {
    std::error_code error;
    const auto written = std::filesystem::last_write_time(path_of(device, file), error);
    if (error || written < newest) continue;
    newest = written;
    device.last_file = file;
  }
}

}  // namespace rtpm::deviced
