//! What an adapter does with the bytes that it receives. [`ask`] lets its driver hand them on at once, [`give_back`]
//! lets it do as it did; [`Adapter`] is what the kernel says of it.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use rustix::ioctl::{Opcode, Updater, ioctl};

/// `ASYNC_LOW_LATENCY`: the driver hands on each byte at once. That of FTDI sets the adapter's timer to 1 ms.
const LOW_LATENCY: i32 = 1 << 13;

/// The kernel's `serial_struct`. What is read is written back but for the flag.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct DriverSettings {
    /// Type, line, port and interrupt.
    kind: [i32; 4],
    flags: i32,
    /// Length of the queue, divisor and base of the speed.
    speed: [i32; 3],
    close_delay: u16,
    io_type: [u8; 2],
    hub6: i32,
    closing_wait: [u16; 2],
    memory: usize,
    memory_shift: u16,
    port_high: u32,
    map: usize,
}

// 60 bytes where an address has four.
const _: () = assert!(size_of::<DriverSettings>() == 48 + 3 * size_of::<usize>());

/// The driver of a port, which a test stands in for.
pub(super) trait Driver {
    /// Its settings.
    ///
    /// # Errors
    /// It has none: most drivers do.
    fn settings(&self) -> io::Result<DriverSettings>;

    /// Gives it others.
    ///
    /// # Errors
    /// It does not take them.
    fn set(&self, settings: DriverSettings) -> io::Result<()>;
}

impl Driver for File {
    fn settings(&self) -> io::Result<DriverSettings> {
        let mut settings = DriverSettings::default();
        // SAFETY: the kernel writes a `serial_struct`, which this is.
        #[allow(unsafe_code)]
        unsafe {
            let get = Updater::<{ libc::TIOCGSERIAL as Opcode }, _>::new(&mut settings);
            ioctl(self, get)?;
        }
        Ok(settings)
    }

    fn set(&self, mut settings: DriverSettings) -> io::Result<()> {
        // SAFETY: the kernel reads a `serial_struct`, which this is.
        #[allow(unsafe_code)]
        unsafe {
            let set = Updater::<{ libc::TIOCSSERIAL as Opcode }, _>::new(&mut settings);
            Ok(ioctl(self, set)?)
        }
    }
}

/// Asks the driver to hand on each byte at once. Says whether that changed something, which is to be given back. A
/// driver that knows no such thing stays as it is.
pub(super) fn ask(driver: &impl Driver) -> bool {
    let found = driver.settings().ok();
    let found = found.filter(|found| found.flags & LOW_LATENCY == 0);
    found.is_some_and(|found| {
        let flags = found.flags | LOW_LATENCY;
        driver.set(DriverSettings { flags, ..found }).is_ok()
    })
}

/// Lets the driver do as it did before [`ask`] changed it.
pub(super) fn give_back(driver: &impl Driver) {
    if let Ok(found) = driver.settings() {
        let flags = found.flags & !LOW_LATENCY;
        // A device that is gone has nothing to give back.
        let _ = driver.set(DriverSettings { flags, ..found });
    }
}

/// Where the kernel shows the ports of USB adapters.
const DEVICES: &str = "/sys/bus/usb-serial/devices";

/// A USB adapter, as the kernel shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// The name of its driver.
    pub driver: String,
    /// For how long it keeps bytes back at most, ms; `None` if it does not say.
    pub latency_ms: Option<u32>,
}

impl Adapter {
    /// The adapter behind `port`; `None` if that is none of USB. Opens no device.
    pub fn look(port: &Path) -> Option<Adapter> {
        Adapter::look_in(Path::new(DEVICES), port)
    }

    fn look_in(devices: &Path, port: &Path) -> Option<Adapter> {
        let device = fs::canonicalize(port).ok()?;
        let shown = devices.join(device.file_name()?);
        let driver = fs::read_link(shown.join("driver")).ok()?;
        let timer = fs::read_to_string(shown.join("latency_timer")).ok();
        Some(Adapter {
            driver: driver.file_name()?.to_string_lossy().into_owned(),
            latency_ms: timer.and_then(|text| text.trim().parse().ok()),
        })
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::os::unix::fs::symlink;

    use super::*;

    const OTHERS: i32 = 0x1010;

    /// A driver with these flags, if it has any, that takes others or does not; and how often it was given some.
    struct StandIn {
        flags: Option<Cell<i32>>,
        takes: bool,
        given: Cell<u32>,
    }

    impl Driver for StandIn {
        fn settings(&self) -> io::Result<DriverSettings> {
            let flags = self.flags.as_ref().ok_or(io::ErrorKind::Unsupported)?.get();
            let hub6 = 7;
            Ok(DriverSettings {
                flags,
                hub6,
                ..DriverSettings::default()
            })
        }

        fn set(&self, settings: DriverSettings) -> io::Result<()> {
            let flags = self.flags.as_ref().filter(|_| self.takes);
            flags
                .ok_or(io::ErrorKind::PermissionDenied)?
                .set(settings.flags);
            assert_eq!(settings.hub6, 7, "the rest stays");
            self.given.set(self.given.get() + 1);
            Ok(())
        }
    }

    #[test]
    fn a_driver_is_asked_and_gets_back_what_it_had_and_one_without_is_left_alone() {
        for (flags, takes, is_changed, during) in [
            (Some(OTHERS), true, true, Some(OTHERS | LOW_LATENCY)),
            (
                Some(OTHERS | LOW_LATENCY),
                true,
                false,
                Some(OTHERS | LOW_LATENCY),
            ),
            (Some(OTHERS), false, false, Some(OTHERS)),
            (None, true, false, None),
        ] {
            let driver = StandIn {
                flags: flags.map(Cell::new),
                takes,
                given: Cell::new(0),
            };
            let now = || driver.flags.as_ref().map(Cell::get);
            assert_eq!(ask(&driver), is_changed, "{flags:?}");
            assert_eq!(now(), during);
            assert_eq!(driver.given.get(), u32::from(is_changed));
            if is_changed {
                give_back(&driver);
                assert_eq!(now(), flags);
            }
        }
    }

    #[test]
    fn a_terminal_without_a_driver_that_has_settings_is_left_alone() {
        let master = rustix::pty::openpt(rustix::pty::OpenptFlags::NOCTTY).unwrap();
        assert!(!ask(&File::from(master)));
    }

    #[test]
    fn what_the_kernel_shows_of_an_adapter_is_found_by_the_port_s_link() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, driver, timer) in [
            ("ttyUSB0", "ftdi_sio", Some("16\n")),
            ("ttyUSB1", "cp210x", None),
        ] {
            fs::create_dir_all(at("devices").join(name)).unwrap();
            symlink(
                format!("/sys/bus/usb-serial/drivers/{driver}"),
                at("devices").join(name).join("driver"),
            )
            .unwrap();
            if let Some(timer) = timer {
                fs::write(at("devices").join(name).join("latency_timer"), timer).unwrap();
            }
            fs::write(at(name), "").unwrap();
        }
        symlink("ttyUSB0", at("hero-dsp")).unwrap();
        fs::write(at("ttyS0"), "").unwrap();
        let look = |port: &str| Adapter::look_in(&at("devices"), &at(port));
        let shown = |driver: &str, latency_ms| {
            Some(Adapter {
                driver: driver.to_owned(),
                latency_ms,
            })
        };
        assert_eq!(look("hero-dsp"), shown("ftdi_sio", Some(16)));
        assert_eq!(look("ttyUSB1"), shown("cp210x", None));
        assert_eq!(look("ttyS0"), None);
        assert_eq!(look("absent"), None);
    }
}
