package org.rtpm.values;

/** An object that a server can serve; generated servant interfaces extend it. */
public interface Servant {
  /** The methods of this object. */
  Skeleton skeleton();
}
