//! The machine's model, processor, memory and graphics, without serial numbers.

use std::fs;
use std::path::Path;

use bokehcam::compute::thread_pool::core_count;

/// Returns a line each for the machine, its processor, its memory and its graphics.
pub fn describe_hardware() -> Vec<String> {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default().trim_matches(['\0', '\n', ' ']).to_owned();
    let dmi_name = ["sys_vendor", "product_name"].map(|name| read(&format!("/sys/class/dmi/id/{name}"))).join(" ");
    let model = if dmi_name.trim().is_empty() { read("/proc/device-tree/model") } else { dmi_name };
    let processors = read("/proc/cpuinfo");
    let processor = find_value(&processors, "model name").unwrap_or(std::env::consts::ARCH);
    let memory_kib =
        find_value(&read("/proc/meminfo"), "MemTotal").and_then(|text| text.split(' ').next()?.parse().ok());
    let memory = memory_kib.map_or("unknown".to_owned(), |kib: u64| format!("{:.1} GiB", kib as f64 / 1_048_576.0));
    let mut lines = vec![
        format!("machine: {}", if model.trim().is_empty() { "unknown" } else { model.trim() }),
        format!("processor: {processor}, {} threads", core_count()),
        format!("memory: {memory}"),
    ];
    lines.extend(list_graphics_cards(Path::new("/sys/class/drm")).into_iter().map(|card| format!("graphics: {card}")));
    let nvidia = read("/sys/module/nvidia/version");
    if !nvidia.is_empty() {
        lines.push(format!("graphics: kernel module nvidia {nvidia}"));
    }
    lines.extend(list_vulkan_adapters().into_iter().map(|adapter| format!("Vulkan: {adapter}")));
    lines
}

/// Returns the value of the first line of the form `key : value`.
fn find_value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let parse_line = |line: &'a str| line.strip_prefix(key)?.trim_start().strip_prefix(':').map(str::trim);
    text.lines().find_map(parse_line)
}

/// Returns the driver and the PCI vendor and model ids of each graphics card that the kernel lists.
fn list_graphics_cards(class: &Path) -> Vec<String> {
    let entries = fs::read_dir(class).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
    // The class also holds connectors, such as card0-DP-1.
    names.retain(|name| name.strip_prefix("card").is_some_and(|number| number.bytes().all(|b| b.is_ascii_digit())));
    names.sort();
    let card = |name: &String| {
        let uevent = fs::read_to_string(class.join(name).join("device/uevent")).ok()?;
        let field = |key: &str| uevent.lines().find_map(|line| line.strip_prefix(key)).unwrap_or("unknown");
        Some(format!("driver {}, PCI {}", field("DRIVER="), field("PCI_ID=")))
    };
    names.iter().filter_map(card).collect()
}

fn list_vulkan_adapters() -> Vec<String> {
    let adapters = bokehcam::compute::device::list_adapters();
    if adapters.is_empty() { vec!["no adapter, or no loader (libvulkan.so.1)".to_owned()] } else { adapters }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_have_a_driver_and_connectors_are_none() {
        let class = tempfile::tempdir().unwrap();
        for (name, uevent) in
            [("card1", "DRIVER=i915\nPCI_ID=8086:9A49\n"), ("card1-DP-1", ""), ("renderD128", "DRIVER=i915\n")]
        {
            fs::create_dir_all(class.path().join(name).join("device")).unwrap();
            fs::write(class.path().join(name).join("device/uevent"), uevent).unwrap();
        }
        assert_eq!(list_graphics_cards(class.path()), ["driver i915, PCI 8086:9A49"]);
        assert_eq!(list_graphics_cards(&class.path().join("none")), Vec::<String>::new());
    }

    #[test]
    fn a_key_is_a_whole_word() {
        let text = "model\t\t: 85\nmodel name\t: A Processor @ 2 GHz: fast\n";
        assert_eq!(
            (find_value(text, "model name"), find_value(text, "Serial")),
            (Some("A Processor @ 2 GHz: fast"), None)
        );
    }
}
