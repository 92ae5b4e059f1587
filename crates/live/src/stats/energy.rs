//! Energy of the processor, from the counters of the kernel's power capping framework (RAPL).

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Where the kernel has its power zones.
const ROOT: &str = "/sys/class/powercap";
/// No package takes more than this for long: a run may be as long as the counters last at this power.
const MAX_POWER_W: f64 = 400.0;

/// Measures the energy of all processor packages, that of other programs included.
#[derive(Debug)]
pub struct EnergyMeter {
    began: Instant,
    packages: Result<Vec<Package>, String>,
}

/// A package's counter, in microjoules.
#[derive(Debug)]
struct Package {
    counter: PathBuf,
    began_uj: u64,
    /// Value after which the counter starts at 0 again.
    range_uj: u64,
}

impl EnergyMeter {
    /// Starts measuring.
    pub fn start() -> Self {
        Self::start_in(Path::new(ROOT))
    }

    fn start_in(root: &Path) -> Self {
        Self { began: Instant::now(), packages: find_packages(root) }
    }

    /// Returns the energy since the start in joules.
    ///
    /// # Errors
    /// Returns the reason why it is unknown: no counters, no permission to read them, or a run longer than they last.
    pub fn joules(&self) -> Result<f64, String> {
        let packages = self.packages.as_ref().map_err(Clone::clone)?;
        let lasts_s =
            packages.iter().map(|package| package.range_uj as f64).fold(f64::MAX, f64::min) / 1e6 / MAX_POWER_W;
        if self.began.elapsed().as_secs_f64() > lasts_s {
            return Err(format!("the processor's energy counters are only sure to last {:.0} min", lasts_s / 60.0));
        }
        let mut sum_uj = 0;
        for Package { counter, began_uj, range_uj } in packages {
            let now_uj = read_number(counter)?;
            sum_uj += now_uj.checked_sub(*began_uj).unwrap_or(now_uj + range_uj.saturating_sub(*began_uj));
        }
        Ok(sum_uj as f64 / 1e6)
    }
}

fn find_packages(root: &Path) -> Result<Vec<Package>, String> {
    let zones = fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.path());
    // The zones of cores, graphics and memory are parts of their package or another measure of the same energy.
    let is_package =
        |zone: &PathBuf| fs::read_to_string(zone.join("name")).is_ok_and(|name| name.starts_with("package"));
    let packages = zones.filter(is_package).map(|zone| {
        let (counter, range_uj) = (zone.join("energy_uj"), read_number(&zone.join("max_energy_range_uj"))?);
        Ok(Package { began_uj: read_number(&counter)?, counter, range_uj })
    });
    let packages = packages.collect::<Result<Vec<_>, String>>()?;
    if packages.is_empty() {
        return Err(format!("the kernel has no energy counters of the processor in {}", root.display()));
    }
    Ok(packages)
}

fn read_number(path: &Path) -> Result<u64, String> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    text.trim().parse().map_err(|_| format!("{}: not a number", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set_zone(root: &Path, zone: &str, name: &str, energy_uj: &str) {
        let zone = root.join(zone);
        fs::create_dir_all(&zone).unwrap();
        for (file, value) in [("name", name), ("energy_uj", energy_uj), ("max_energy_range_uj", "262143328850")] {
            fs::write(zone.join(file), format!("{value}\n")).unwrap();
        }
    }

    #[test]
    fn packages_are_summed_and_counters_may_start_again() {
        let root = tempfile::tempdir().unwrap();
        set_zone(root.path(), "intel-rapl:0", "package-0", "5000000");
        set_zone(root.path(), "intel-rapl:1", "package-1", "262143000000");
        set_zone(root.path(), "intel-rapl:0:0", "core", "1");
        set_zone(root.path(), "intel-rapl:2", "psys", "1");
        let meter = EnergyMeter::start_in(root.path());
        assert_eq!(meter.joules(), Ok(0.0));
        set_zone(root.path(), "intel-rapl:0", "package-0", "7500000");
        set_zone(root.path(), "intel-rapl:1", "package-1", "171150");
        set_zone(root.path(), "intel-rapl:0:0", "core", "900000000");
        assert_eq!(meter.joules(), Ok(3.0));
    }

    #[test]
    fn what_cannot_be_read_is_said() {
        let root = tempfile::tempdir().unwrap();
        let reason = EnergyMeter::start_in(root.path()).joules().unwrap_err();
        assert!(reason.contains("no energy counters"), "{reason}");
        set_zone(root.path(), "intel-rapl:0", "package-0", "many");
        let reason = EnergyMeter::start_in(root.path()).joules().unwrap_err();
        assert!(reason.ends_with("intel-rapl:0/energy_uj: not a number"), "{reason}");
    }
}
