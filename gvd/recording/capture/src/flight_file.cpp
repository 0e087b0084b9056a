#include "rtpm/capture/flight_file.hpp"

#include <string>
#include <utility>

#include "flatbuffer_channel.hpp"
#include "rtpm/capture/channels.hpp"
#include "rtpm/gvd/flight_cycle.hpp"
#include "rtpm/recording/file_writer.hpp"
#include "rtpm/rt/clock.hpp"
#include "rtpm/rt/utc.hpp"
#include "rtpm/schema/dynamic.hpp"

namespace rtpm::capture {
namespace {

recording::Metadata metadata_of(const std::string& device, const gvd::FlightLog& log) {
  return {.name = "rtpm.flight",
          .values = {{"device", device},
                     {"cause", std::string(to_string(log.cause))},
                     {"number", std::to_string(log.number)},
                     {"fault_cycle", std::to_string(log.cycle)},
                     {"cycle_count", std::to_string(log.records.size())}}};
}

expected<void, SetupError> write_cycles(recording::FileWriter& file, std::uint16_t channel,
                                        schema::Dynamic& dynamic, const gvd::FlightLog& log) {
  const MonotonicTime now = rt::now();
  const std::int64_t offset_ns =
      static_cast<std::int64_t>(rt::utc_ns(now)) - to_ns(now) - log.clock_offset.count();
  for (const gvd::FlightRecord& record : log.records) {
    const auto payload = gvd::flight_cycle_payload(record);
    const auto table = dynamic.as_table(dynamic.event(), payload);
    if (!table) return setup_error("a cycle does not fit its schema");
    const auto time_ns = static_cast<std::uint64_t>(to_ns(record.time) + offset_ns);
    const auto written =
        file.write(recording::Message{.channel_id = channel,
                                      .sequence = static_cast<std::uint32_t>(record.cycle),
                                      .log_time_ns = time_ns,
                                      .publish_time_ns = time_ns,
                                      .data = *table});
    if (!written) return written;
  }
  return {};
}

expected<void, SetupError> write_all(recording::FileWriter& file, const std::string& device,
                                     const gvd::FlightLog& log) {
  const events::EventDescriptor& type = gvd::flight_cycle_type();
  std::string error;
  const auto dynamic = schema::Dynamic::make_for_event(std::string(type.schema), type.name, error);
  if (!dynamic) return setup_error("the schema of flight records can't be read", error);
  const auto channel =
      add_flatbuffer_channel(file, *dynamic, std::string(type.name), device + "/flight",
                             {{"rtpm.kind", "flight"}, {kDeviceKey, device}});
  if (!channel) return unexpected{channel.error()};
  if (auto written = file.write(metadata_of(device, log)); !written) return written;
  return write_cycles(file, *channel, *dynamic, log);
}

}  // namespace

expected<void, SetupError> write_flight_file(const std::string& path, const std::string& device,
                                             const gvd::FlightLog& log,
                                             recording::Existing existing) {
  auto made = recording::NewRecording::create(path, {.profile = "rtpm"}, existing);
  if (!made) return unexpected{std::move(made.error())};
  if (auto written = write_all(made->writer(), device, log); !written) return written;
  const auto finished = made->finish();
  return finished ? expected<void, SetupError>{} : unexpected{finished.error()};
}

}  // namespace rtpm::capture
