// A shared library that is not a plug-in.
extern "C" int rtpm_driver_plugin_of_another_name() {
  return 0;
}
