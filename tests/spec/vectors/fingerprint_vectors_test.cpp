#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "rtpm/schema/fingerprint.hpp"
#include "scratch_folder.hpp"

// spec/vectors/fingerprints.json, and so section 12.1 of the page, against the schema compiler.
namespace rtpm::schema {
namespace {

TEST(FingerprintVectors, MatchTheCompiler) {
  std::ifstream file(RTPM_SPEC_DIR "/vectors/fingerprints.json");
  const auto document = nlohmann::json::parse(file);
  EXPECT_FALSE(document.at("vectors").empty());
  for (const auto& vector : document.at("vectors")) {
    SCOPED_TRACE(vector.at("name"));
    const Model model = test::model_of(vector.at("schema").get<std::string>());
    ASSERT_EQ(model.services.size(), 1u);
    const Service& service = model.services.front();
    EXPECT_EQ(service.name, vector.at("service"));
    EXPECT_EQ(canonical_text(model, service), vector.at("text"));
    EXPECT_EQ(service.fingerprint,
              std::stoull(vector.at("fingerprint").get<std::string>(), nullptr, 16));
    ASSERT_EQ(service.methods.size(), vector.at("methods").size());
    for (const auto& shown : vector.at("methods")) {
      const auto method =
          std::ranges::find(service.methods, shown.at("id").get<int>(), &Method::id);
      ASSERT_NE(method, service.methods.end());
      EXPECT_EQ(canonical_text(model, *method), shown.at("text"));
      EXPECT_EQ(method->fingerprint, shown.at("fingerprint"));
    }
  }
}

}  // namespace
}  // namespace rtpm::schema
