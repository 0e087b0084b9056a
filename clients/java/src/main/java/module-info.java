/** RTPM in Java: calls objects of RTPM's servers, and serves objects. */
module org.rtpm {
  exports org.rtpm;
  exports org.rtpm.values;
  exports rtpm;
  exports rtpm.configuration;
  exports rtpm.device;
  exports rtpm.events;
  exports rtpm.names;
}
