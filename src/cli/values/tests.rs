use super::*;
use crate::look::Tilt;

#[test]
fn apertures_read_back_what_they_print() {
    for text in ["disc", "ring:0.5", "polygon:5", "polygon:6:15", "polygon:8:0:0.5", "heart", "star:5", "image:a:b.png"]
    {
        assert_eq!(text.parse::<ApertureName>().unwrap().to_string(), text);
    }
}

#[test]
fn wrong_values_say_what_is_accepted() {
    for text in ["", "circle", "ring", "ring:1", "ring:nan", "polygon:2", "polygon:5:0:2", "star:99", "image:"] {
        assert!(text.parse::<ApertureName>().unwrap_err().contains("polygon:N"), "{text}");
    }
    for text in ["0", "-1", "inf", "0.5", "far", "0.5,1.1", "0.5,", "1,1,1"] {
        let accepted = text.parse::<Focus>();
        assert_eq!(accepted.is_ok(), text == "0.5", "{text}: {accepted:?}");
    }
    for text in ["640", "0x480", "640x", "99999x1"] {
        assert!(text.parse::<Size>().unwrap_err().contains("1280x720"), "{text}");
    }
    for text in ["0", "17", "all"] {
        assert!(text.parse::<Rank>().unwrap_err().contains("1 to 16"), "{text}");
    }
    assert!("0.5:0.1:0:0".parse::<Tilt>().is_err());
    assert_eq!("0.6".parse(), Ok(Tilt { center_y: 0.6, band: 0.15, angle_deg: 0.0 }));
}
