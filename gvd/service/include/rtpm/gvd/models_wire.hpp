#pragma once

#include <cstdint>
#include <device.rtpm.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/models/model.hpp"

/// Converts between models and schema types.
namespace rtpm::gvd {

/// @realtime set-up only
[[nodiscard]] std::vector<std::unique_ptr<device::ModelT>> to_wire(std::span<const Model> models);
/// @realtime alloc-free, except for an error
/// @errors   described in words: more than ModelList::kCountMax models; a model without a kind, or
///           of a later version
[[nodiscard]] expected<ModelList, std::string> from_wire(const device::SetModelsRequest& wire);

/// The models of an event of type kModelsRendered; nullopt if it is malformed or of another version.
/// @realtime alloc-free
[[nodiscard]] std::optional<ModelList> models_of(std::uint64_t schema_id, ConstBytes payload);

}  // namespace rtpm::gvd
