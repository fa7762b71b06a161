//! The exit codes, for the help.

/// What each exit code means, for the end of the help.
pub const EXIT_CODES: &str = "\
Exit codes:
   0  done
   1  internal error
   2  usage error
   3  the process that should answer does not run
   4  no answer in time, or the DSP did not acknowledge
   5  refused, or ended early; the reason is printed
   6  the link to the DSP, or the relay's link to the robot, is down
   7  the outcome cannot be known
   8  something is not in order; the findings are printed
  78  the configuration is wrong";
