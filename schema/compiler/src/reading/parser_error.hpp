#pragma once

#include <flatbuffers/idl.h>

#include <cstddef>
#include <string>

#include "rtpm/schema/diagnostic.hpp"
#include "rtpm/schema/source.hpp"

namespace rtpm::schema {

/// An error as FlatBuffers' parser reports it.
struct RawError {
  std::size_t line = 0;         ///< Counts from 1.
  std::size_t column_byte = 0;  ///< Counts from 0; after the last token read.
  std::string message{};
};

/// The error in the parser's own words, with its position in `source`.
/// @param parser  the parser that failed; its types are candidates for a misspelt one
[[nodiscard]] Diagnostic diagnostic_of(const RawError& error, const SourceFile& source,
                                       const flatbuffers::Parser& parser);

}  // namespace rtpm::schema
