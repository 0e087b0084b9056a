% Pushes a device and reads it, in Octave; RTPM_JAR is the path of rtpm-0.1.0.jar.
javaaddpath(getenv("RTPM_JAR"));
node = javaMethod("open", "org.rtpm.Node");
arm = javaMethod("open", "org.rtpm.Device", node, "lab/arm0");
lease = arm.acquire(javaMethod("ofSeconds", "java.time.Duration", 1));
force = javaObject("rtpm.device.Vector3", 0, 0, 1);   % newton
lease.force(force, javaMethod("ofMillis", "java.time.Duration", 100));
pause(0.05);
sample = arm.read();
at = sample.positionM();
printf("at %.1f %.1f %.1f mm, force %.2f N\n", 1e3 * at.x(), 1e3 * at.y(), 1e3 * at.z(), sample.forceNewton().z());
lease.close();
arm.close();
node.close();
