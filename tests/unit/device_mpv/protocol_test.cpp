#include "rtpm/device_mpv/protocol.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rtpm::device_mpv {
namespace {

TEST(Protocol, WritesCommandsAsMpvReadsThem) {
  EXPECT_EQ(command_line(7, "seek", {12.5, "absolute+exact"}),
            "{\"command\":[\"seek\",12.5,\"absolute+exact\"],\"request_id\":7}\n");
  EXPECT_EQ(command_line(8, "set_property", {"pause", true}),
            "{\"command\":[\"set_property\",\"pause\",true],\"request_id\":8}\n");
}

TEST(Protocol, ReadsNumbersAndFlags) {
  const Message number = parse(R"({"data":12.04,"request_id":5,"error":"success"})");
  const auto& reply = std::get<Reply>(number);
  EXPECT_EQ(reply.request_id, 5);
  EXPECT_TRUE(reply.is_success);
  EXPECT_EQ(reply.number, 12.04);
  EXPECT_FALSE(reply.flag);
  EXPECT_EQ(std::get<Reply>(parse(R"({"data":true,"request_id":6,"error":"success"})")).flag, true);
}

TEST(Protocol, ReadsRefusals) {
  const Message refused = parse(R"({"request_id":9,"error":"property unavailable"})");
  EXPECT_FALSE(std::get<Reply>(refused).is_success);
  EXPECT_FALSE(std::get<Reply>(refused).number);
}

TEST(Protocol, RecognizesEvents) {
  EXPECT_TRUE(std::holds_alternative<Event>(parse(R"({"event":"seek"})")));
  EXPECT_TRUE(std::holds_alternative<Event>(
      parse(R"({"event":"property-change","id":1,"name":"time-pos","data":1.0})")));
}

TEST(Protocol, ReportsEverythingElseAsUnreadable) {
  const std::vector<std::string> lines{
      "",
      "garbage",
      "{",
      "[]",
      "3",
      "null",
      R"({"request_id":"5","error":"success"})",
      R"({"request_id":5.5,"error":"success"})",
      R"({"request_id":5})",
      R"({"request_id":5,"error":3})",
      R"({"data":1e999,"request_id":5,"error":"success"})",
      "{\"data\":\"\xff\xfe\",\"request_id\":5,\"error\":\"success\"}",
      std::string(8000, '['),
  };
  for (const std::string& line : lines) {
    EXPECT_TRUE(std::holds_alternative<Unreadable>(parse(line))) << line;
  }
}

std::vector<std::string> lines_of(LineCutter& cutter, std::string_view bytes) {
  std::vector<std::string> lines;
  cutter.push(bytes, [&](std::string_view line) { lines.emplace_back(line); });
  return lines;
}

TEST(LineCutter, PutsLinesTogetherAndApart) {
  LineCutter cutter;
  EXPECT_TRUE(lines_of(cutter, "on").empty());
  EXPECT_EQ(lines_of(cutter, "e\ntwo\n\nthr"), (std::vector<std::string>{"one", "two"}));
  EXPECT_EQ(lines_of(cutter, "ee\n"), (std::vector<std::string>{"three"}));
}

TEST(LineCutter, DropsLinesThatAreTooLongAndNothingElse) {
  LineCutter cutter;
  EXPECT_EQ(lines_of(cutter, std::string(kLineSizeMax, 'x') + "\n").size(), 1u);
  EXPECT_EQ(cutter.overlong_count(), 0u);
  EXPECT_TRUE(lines_of(cutter, std::string(kLineSizeMax + 1, 'x')).empty());
  EXPECT_EQ(lines_of(cutter, "x\nnext\n"), (std::vector<std::string>{"next"}));
  EXPECT_EQ(cutter.overlong_count(), 1u);
}

}  // namespace
}  // namespace rtpm::device_mpv
