#pragma once

#include <device.rtpm.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

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

}  // namespace rtpm::gvd
