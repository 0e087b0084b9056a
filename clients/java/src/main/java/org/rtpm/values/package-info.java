/**
 * Values, and the descriptions of interfaces, that generated code and the runtime share. {@code
 * rtpmc --emit java} generates code for this package; a program seldom names its types.
 */
package org.rtpm.values;
