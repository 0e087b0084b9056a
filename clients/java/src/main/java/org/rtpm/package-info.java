/**
 * RTPM in Java: {@link org.rtpm.Node} binds objects and calls them, {@link org.rtpm.Server} serves
 * objects.
 */
package org.rtpm;
