#include "rtpm/events/trials.hpp"

#include <trial.rtpm.events.hpp>
#include <utility>

namespace rtpm::events {
namespace {

/// Absent where the text is empty.
flatbuffers::Offset<flatbuffers::String> text_of(flatbuffers::FlatBufferBuilder& builder,
                                                 const std::string& text) {
  return text.empty() ? 0 : builder.CreateString(text);
}

}  // namespace

TrialSupplier::TrialSupplier(std::unique_ptr<Supplier> supplier, SourceId source) noexcept
    : supplier_(std::move(supplier)), source_(source) {}

expected<TrialSupplier, SetupError> TrialSupplier::create(rpc::Node& node,
                                                          const std::string& target,
                                                          SourceId source, SupplierConfig config) {
  config.types.push_back(&TrialEvent::kDescriptor);
  auto supplier = Supplier::create(node, target, config);
  if (!supplier) return unexpected{std::move(supplier.error())};
  return TrialSupplier(std::move(*supplier), source);
}

expected<void, rpc::CallError> TrialSupplier::push(const Trial& trial,
                                                   std::optional<MonotonicTime> origin) {
  flatbuffers::FlatBufferBuilder builder;
  const auto condition = text_of(builder, trial.condition);
  const auto response = text_of(builder, trial.response);
  const auto note = text_of(builder, trial.note);
  flatbuffers::Optional<std::uint64_t> duration_ns;
  if (trial.duration) duration_ns = static_cast<std::uint64_t>(trial.duration->count());
  flatbuffers::Optional<std::uint64_t> seed;
  if (trial.seed) seed = *trial.seed;
  builder.Finish(CreateTrial(builder, static_cast<rtpm::TrialPhase>(trial.phase), trial.number,
                             condition, response, seed, note, duration_ns));
  return supplier_->push({.type = TrialEvent::kType,
                          .source = source_,
                          .schema_id = TrialEvent::kSchemaId,
                          .payload = rpc::table_bytes(builder),
                          .origin = origin});
}

}  // namespace rtpm::events
