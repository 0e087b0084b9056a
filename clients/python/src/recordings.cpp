#include "recordings.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "errors.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/capture/read_events.hpp"
#include "rtpm/recording/file_reader.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/schema_text.hpp"
#include "schema.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace rtpm::python {
namespace {

using recording::FileReader;
using recording::Message;

/// A page of messages ends after this many bytes or messages.
constexpr std::size_t kPageByteMax = std::size_t{4} << 20;
constexpr std::size_t kPageCountMax = 16'384;

/// An open file.
/// @threads any; one reads at a time
struct Recording {
  std::string path;
  std::mutex mutex{};
  std::unique_ptr<FileReader> reader{};
};
using SharedRecording = std::shared_ptr<Recording>;

[[noreturn]] void raise_recording(const std::string& path, const SetupError& error) {
  const RunsPython scope;
  raise_object(nb::module_::import_("rtpm.errors")
                   .attr("of_recording")(path, error.what, error.why, error.remedy));
}

SharedRecording open(const std::string& path, bool is_incomplete_read) {
  using Opened = expected<std::unique_ptr<FileReader>, SetupError>;
  const auto incomplete =
      is_incomplete_read ? recording::Incomplete::kRead : recording::Incomplete::kRefuse;
  auto opened =
      interruptible<Opened>([path, incomplete] { return FileReader::open(path, incomplete); });
  if (!opened) raise_recording(path, opened.error());
  auto result = std::make_shared<Recording>();
  result->path = path;
  result->reader = *std::move(opened);
  return result;
}

/// Number, topic, type, encoding, count and metadata of each channel.
nb::list channels(const Recording& self) {
  const auto& counts = self.reader->statistics().message_counts;
  nb::list list;
  for (const auto& [number, channel] : self.reader->channels()) {
    const auto schema = self.reader->schemas().find(channel.schema_id);
    const bool is_known = schema != self.reader->schemas().end();
    const auto count = counts.find(number);
    list.append(nb::make_tuple(number, channel.topic, is_known ? schema->second.name : "",
                               channel.message_encoding, count != counts.end() ? count->second : 0,
                               channel.metadata));
  }
  return list;
}

/// The channel's schema as text, and why it can't be read; both empty if the file has none.
nb::tuple schema_of(const Recording& self, std::uint16_t number) {
  const auto schema = self.reader->schemas().find(self.reader->channels().at(number).schema_id);
  if (schema == self.reader->schemas().end() || schema->second.encoding != "flatbuffer")
    return nb::make_tuple("", "");
  const auto& data = schema->second.data;
  const auto compiled = schema::compile_binary(
      {static_cast<const std::uint8_t*>(static_cast<const void*>(data.data())), data.size()},
      schema->second.name);
  if (!compiled.model) return nb::make_tuple("", printable(compiled.errors.front().message));
  return nb::make_tuple(schema::schema_text(*compiled.model), "");
}

/// Visits messages on a thread of its own, so that signals end the wait.
void read(const SharedRecording& self, const recording::Query& query,
          std::function<bool(const Message&)> visit) {
  using Done = expected<void, SetupError>;
  const auto done = interruptible<Done>([self, query, visit = std::move(visit)] {
    const std::lock_guard lock(self->mutex);
    return self->reader->read(query, visit);
  });
  if (!done) raise_recording(self->path, done.error());
}

/// A message that a page holds.
struct Held {
  Message message{};
  std::vector<std::byte> data{};
};

/// The next messages from a log time to another, without the first `skip_count` of the first time:
/// channel, sequence, log time, publish time and bytes of each.
nb::list read_page(const SharedRecording& self, std::vector<std::uint16_t> numbers,
                   std::uint64_t from_ns, std::uint64_t to_ns, std::size_t skip_count) {
  struct Page {
    std::vector<Held> messages{};
    std::size_t byte_count = 0;
    std::size_t skip_count = 0;
  };
  const auto page = std::make_shared<Page>();
  page->skip_count = skip_count;
  read(self, {.from_ns = from_ns, .to_ns = to_ns, .channel_ids = std::move(numbers)},
       [page](const Message& message) {
         if (page->skip_count > 0) {
           --page->skip_count;
           return true;
         }
         page->messages.push_back({message, {message.data.begin(), message.data.end()}});
         page->byte_count += message.data.size();
         return page->byte_count < kPageByteMax && page->messages.size() < kPageCountMax;
       });
  nb::list list;
  for (const auto& [message, data] : page->messages) {
    list.append(nb::make_tuple(message.channel_id, message.sequence, message.log_time_ns,
                               message.publish_time_ns, nb::bytes(data.data(), data.size())));
  }
  return list;
}

/// The messages of channels of a struct, packed: the publish time, then the struct.
nb::bytearray read_records(const SharedRecording& self, std::vector<std::uint16_t> numbers,
                           std::uint64_t from_ns, std::uint64_t to_ns, std::size_t struct_size,
                           std::size_t offset, std::size_t record_size) {
  struct Records {
    std::vector<std::byte> bytes{};
    bool is_broken = false;
  };
  const auto records = std::make_shared<Records>();
  read(self, {.from_ns = from_ns, .to_ns = to_ns, .channel_ids = std::move(numbers)},
       [records, struct_size, offset, record_size](const Message& message) {
         const ConstBytes value = capture::struct_in_table(message.data, struct_size);
         records->is_broken = value.empty();
         if (records->is_broken) return false;
         const std::size_t at = records->bytes.size();
         records->bytes.resize(at + record_size);
         std::memcpy(&records->bytes[at], &message.publish_time_ns, sizeof(std::uint64_t));
         std::memcpy(&records->bytes[at + offset], value.data(), struct_size);
         return true;
       });
  if (records->is_broken) {
    raise_recording(self->path, {.what = "a message does not match its schema",
                                 .remedy = "see what else is damaged: rtpm bag check"});
  }
  return nb::bytearray(records->bytes.data(), records->bytes.size());
}

/// The value of a recorded message: a FlatBuffer whose root is the object, also for a bare struct.
nb::object decode(const SharedRecording& self, const Schema& schema, std::size_t object,
                  const nb::bytes& bytes) {
  const ConstBytes data(static_cast<const std::byte*>(bytes.data()), bytes.size());
  const auto payload = schema::payload_of(schema.codec().model(), object);
  switch (payload.kind) {
    case schema::PayloadKind::kEmpty:
      return nb::none();
    case schema::PayloadKind::kTable:
      return schema.codec().decode(payload, data);
    case schema::PayloadKind::kStruct:
      break;
  }
  const std::size_t size = schema.codec().model().objects[*payload.struct_index].byte_size;
  const ConstBytes value = capture::struct_in_table(data, size);
  if (!value.empty()) return schema.codec().struct_from(*payload.struct_index, value);
  raise_recording(self->path, {.what = "a message does not match its schema",
                               .remedy = "see what else is damaged: rtpm bag check"});
}

nb::list metadata(const SharedRecording& self) {
  using Read = expected<std::vector<recording::Metadata>, SetupError>;
  const auto found = interruptible<Read>([self] {
    const std::lock_guard lock(self->mutex);
    return self->reader->read_metadata();
  });
  if (!found) raise_recording(self->path, found.error());
  nb::list list;
  for (const recording::Metadata& each : *found)
    list.append(nb::make_tuple(each.name, each.values));
  return list;
}

}  // namespace

void define_recordings(nb::module_& module) {
  nb::class_<Recording>(module, "Recording")
      .def(nb::new_(&open), "path"_a, "is_incomplete_read"_a)
      .def_prop_ro("is_complete", [](const Recording& self) { return self.reader->is_complete(); })
      .def_prop_ro("begin_ns",
                   [](const Recording& self) { return self.reader->statistics().begin_ns; })
      .def_prop_ro("end_ns", [](const Recording& self) { return self.reader->statistics().end_ns; })
      .def("channels", &channels)
      .def("schema_of", &schema_of, "channel"_a)
      .def("read_page", &read_page, "channels"_a, "from_ns"_a, "to_ns"_a, "skip_count"_a)
      .def("read_records", &read_records, "channels"_a, "from_ns"_a, "to_ns"_a, "struct_size"_a,
           "offset"_a, "record_size"_a)
      .def("decode", &decode, "schema"_a, "object"_a, "data"_a)
      .def("metadata", &metadata);
}

}  // namespace rtpm::python
