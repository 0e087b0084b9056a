#include "rtpm/introspection/catalog.hpp"

#include <gtest/gtest.h>

#include <string>

#include "room.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::introspection {
namespace {

class CatalogOfARoom : public testing::Test {
 protected:
  CatalogOfARoom() {
    auto bound = IntrospectionClient::bind(node_, room_.url(kPath));
    EXPECT_TRUE(bound) << bound.error().text();
    client_ = std::make_unique<IntrospectionClient>(std::move(*bound));
  }

  test::Room room_{};
  rpc::Node node_{};
  std::unique_ptr<IntrospectionClient> client_{};
};

TEST_F(CatalogOfARoom, ListsTheObjects) {
  const auto reply = client_->list();
  ASSERT_TRUE(reply);
  ASSERT_EQ((*reply)->objects()->size(), 1u);
  EXPECT_EQ((*reply)->objects()->Get(0)->path()->str(), "room/light");
  EXPECT_EQ((*reply)->objects()->Get(0)->interface()->str(), "room.Light");
}

TEST_F(CatalogOfARoom, DescribesByPathAndByInterface) {
  DescribeRequestT by_path;
  by_path.path = "room/light";
  DescribeRequestT by_interface;
  by_interface.interface = "room.Light";
  for (const DescribeRequestT& request : {by_path, by_interface}) {
    const auto reply = client_->describe(request);
    ASSERT_TRUE(reply);
    const auto& interface = room::LightClient::interface();
    EXPECT_EQ((*reply)->interface()->str(), interface.name);
    EXPECT_EQ((*reply)->fingerprint(), interface.fingerprint);
    EXPECT_EQ((*reply)->schema()->str(), interface.schema);
    EXPECT_NE(interface.schema.find("rpc_service Light"), std::string_view::npos);
  }
}

TEST_F(CatalogOfARoom, RefusesUnknownObjects) {
  DescribeRequestT request;
  request.path = "room/window";
  EXPECT_EQ(client_->describe(request).error(), rpc::CallError::kNoSuchObject);
  request.interface = "room.Light";
  EXPECT_EQ(client_->describe(request).error(), rpc::CallError::kBadRequest);
  EXPECT_EQ(client_->describe(DescribeRequestT{}).error(), rpc::CallError::kBadRequest);
}

}  // namespace
}  // namespace rtpm::introspection
