//! The number of files that the service may open: connections, downloads and objects are files.

#[cfg(unix)]
use nix::sys::resource::{Resource, getrlimit, setrlimit};

/// Open files that are enough for all connections and calls that the service admits.
#[cfg(unix)]
const WANTED: u64 = 65_536;

/// Raises the soft limit of open files, 1,024 on many systems, to what the hard limit allows. A system that refuses leaves it as it is, and
/// the log says so.
pub(super) fn raise() {
    #[cfg(unix)]
    if let Err(error) = raised() {
        tracing::warn!(%error, "the limit of open files stays as it is");
    }
}

#[cfg(unix)]
fn raised() -> nix::Result<()> {
    let (soft, hard) = getrlimit(Resource::RLIMIT_NOFILE)?;
    let wanted = hard.min(WANTED);
    if soft < wanted {
        setrlimit(Resource::RLIMIT_NOFILE, wanted, hard)?;
        tracing::debug!(before = soft, now = wanted, "open files");
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn the_soft_limit_rises_and_never_falls() {
        let (_, hard) = getrlimit(Resource::RLIMIT_NOFILE).expect("limits");
        setrlimit(Resource::RLIMIT_NOFILE, hard.min(512), hard).expect("lowers");
        raised().expect("raises");
        let raised_to = getrlimit(Resource::RLIMIT_NOFILE).expect("limits");
        assert_eq!(raised_to, (hard.min(WANTED), hard));
        raised().expect("stays");
        assert_eq!(
            getrlimit(Resource::RLIMIT_NOFILE).expect("limits"),
            raised_to
        );
    }
}
