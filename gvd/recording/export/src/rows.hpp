#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/recording/mcap.hpp"
#include "rtpm/schema/dynamic.hpp"
#include "table_layout.hpp"

namespace rtpm::exports {

/// Appends `text` in quotation marks as JSON; foreign control characters are escaped.
void append_json_text(std::string& json, std::string_view text);

/// Reads the messages of a channel by its schema, as rows of cells or as JSON.
class Rows {
 public:
  /// @errors   why the schema can't be used, as a clause
  [[nodiscard]] static expected<std::unique_ptr<Rows>, std::string> make(
      const recording::Schema& schema);
  Rows(const Rows&) = delete;
  Rows& operator=(const Rows&) = delete;

  [[nodiscard]] const std::vector<Column>& columns() const noexcept { return columns_; }
  /// Forgets all other columns.
  /// @param is_kept  for each column
  void keep(const std::vector<bool>& is_kept);
  /// Reads a message into one cell for each column; an absent value is empty. Reuses the cells.
  /// @return   whether it matches the schema
  [[nodiscard]] bool read(ConstBytes message, std::vector<std::string>& cells);
  /// Replaces `json` by the message; numbers are exact, bytes are base64, NaN is null.
  /// @return   whether it matches the schema and has less than 64 MiB of text
  [[nodiscard]] bool read_json(ConstBytes message, std::string& json);
  /// The content of a text, or of a vector of bytes; empty if it is absent, or the message or the
  /// column is none.
  [[nodiscard]] std::string read_bytes(ConstBytes message, std::string_view column);

 private:
  Rows(std::unique_ptr<schema::Dynamic> dynamic, schema::Payload payload,
       std::vector<Column> columns) noexcept
      : dynamic_(std::move(dynamic)), payload_(payload), columns_(std::move(columns)) {}

  std::unique_ptr<schema::Dynamic> dynamic_;
  schema::Payload payload_;
  std::vector<Column> columns_;
};

}  // namespace rtpm::exports
