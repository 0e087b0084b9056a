#pragma once

#include <flatbuffers/idl.h>

namespace rtpm::schema {

/// Parses a schema or JSON without opening any file: every `include` fails.
[[nodiscard]] inline bool parse_closed(flatbuffers::Parser& parser, const char* text) {
  const char* no_paths[] = {nullptr};  // A null list would mean the current folder.
  return parser.Parse(text, no_paths, /*source_filename=*/nullptr);
}

}  // namespace rtpm::schema
