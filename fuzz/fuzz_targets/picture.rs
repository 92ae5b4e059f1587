#![no_main]

libfuzzer_sys::fuzz_target!(init: bokehcam_fuzz::spare_caught_panics(), |data: &[u8]| bokehcam_fuzz::picture(data));
