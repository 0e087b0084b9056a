package org.rtpm;

/**
 * A name that is bound.
 *
 * @param name such as {@code lab/arm0}
 * @param address where its object is
 * @param interfaceName of the object
 * @param revision identifies the holder for as long as it holds the name
 */
public record NameEntry(String name, Address address, String interfaceName, long revision) {}
