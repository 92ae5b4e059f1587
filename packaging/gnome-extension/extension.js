// A toggle in GNOME's quick settings: off shows the still card, and the menu lists the presets. It calls
// io.github.bokehcam.bokehcam on the session's message bus, and is hidden while that name has no owner.
import Gio from 'gi://Gio';
import GObject from 'gi://GObject';

import {Extension} from 'resource:///org/gnome/shell/extensions/extension.js';
import * as Main from 'resource:///org/gnome/shell/ui/main.js';
import {QuickMenuToggle, SystemIndicator} from 'resource:///org/gnome/shell/ui/quickSettings.js';

const Camera = Gio.DBusProxy.makeProxyWrapper(`
<node>
  <interface name="io.github.bokehcam.Camera">
    <method name="Toggle"/>
    <method name="SetPreset"><arg type="s" direction="in" name="name"/></method>
    <property name="Active" type="b" access="read"/>
    <property name="Preset" type="s" access="read"/>
    <property name="Presets" type="as" access="read"/>
    <property name="Source" type="s" access="read"/>
  </interface>
</node>`);

const CameraToggle = GObject.registerClass(
class CameraToggle extends QuickMenuToggle {
    _init() {
        super._init({title: 'Portrait camera', iconName: 'camera-web-symbolic', toggleMode: false});
        this._cancellable = new Gio.Cancellable();
        this._camera = new Camera(Gio.DBus.session, 'io.github.bokehcam.bokehcam', '/io/github/bokehcam/bokehcam',
            (_, error) => {
                if (error)
                    return;
                this._changed = this._camera.connect('g-properties-changed', () => this._show());
                this._owner = this._camera.connect('notify::g-name-owner', () => this._show());
                this._show();
            }, this._cancellable, Gio.DBusProxyFlags.DO_NOT_AUTO_START);
        this.connect('clicked', () => this._camera.ToggleAsync().catch(logError));
        this._show();
    }

    _show() {
        this.visible = this._camera.g_name_owner !== null;
        this.checked = this._camera.Active ?? false;
        this.subtitle = this._camera.Preset || null;
        this.menu.removeAll();
        this.menu.setHeader('camera-web-symbolic', 'Portrait camera', this._camera.Source);
        for (const preset of this._camera.Presets ?? [])
            this.menu.addAction(preset, () => this._camera.SetPresetAsync(preset).catch(logError));
    }

    destroy() {
        this._cancellable.cancel();
        for (const handler of [this._changed, this._owner].filter(handler => handler))
            this._camera.disconnect(handler);
        super.destroy();
    }
});

export default class BokehcamExtension extends Extension {
    enable() {
        this._indicator = new SystemIndicator();
        this._indicator.quickSettingsItems.push(new CameraToggle());
        Main.panel.statusArea.quickSettings.addExternalIndicator(this._indicator);
    }

    disable() {
        this._indicator.quickSettingsItems.forEach(item => item.destroy());
        this._indicator.destroy();
        this._indicator = null;
    }
}
