#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evolution_exchange.hpp"
#include "evolution_schema.hpp"

/// A random edit of which both sides are generated, built and run.
namespace rtpm::schema::test {

struct EvolutionSample {
  ChangeKind kind{};
  SchemaText before{};  ///< Each sample has a namespace of its own: "lab0", "lab1".
  SchemaText after{};
};

/// One edit of each kind; all programs get equal edits.
[[nodiscard]] std::vector<EvolutionSample> evolution_samples();

/// The request or reply of a method as `side` writes it; equal in all programs.
[[nodiscard]] std::string sample_message(Side& side, const Payload& payload, std::uint16_t method,
                                         bool is_request);

}  // namespace rtpm::schema::test
