"""How rclpy's functions are called: facts, with where they stand.

Source: ros2/rclpy and ros2/geometry2 on GitHub, each file at the commit next to it.
"""

_NODE = "rclpy/rclpy/node.py, 32e4eae"
_LIFECYCLE = "rclpy/rclpy/lifecycle/node.py, b2f1437"
_EXECUTORS = "rclpy/rclpy/executors.py, f923126 and 01352d6"
_CLOCK = "rclpy/rclpy/clock.py, 0582aaf"

# Defaults other than None, numbers, booleans and texts are written as `...`.
SIGNATURES = {
    "rclpy.init": (
        "(*, args=None, context=None, domain_id=None, signal_handler_options=None)",
        "rclpy/rclpy/__init__.py, 26a7251",
    ),
    "rclpy.shutdown": (
        "(*, context=None, uninstall_handlers=None)",
        "rclpy/rclpy/__init__.py, 26a7251",
    ),
    "rclpy.ok": ("(*, context=None)", "rclpy/rclpy/utilities.py"),
    "rclpy.node.Node": (
        "(node_name, *, context=None, cli_args=None, namespace=None, use_global_arguments=True, "
        "enable_rosout=True, start_parameter_services=True, parameter_overrides=None, "
        "allow_undeclared_parameters=False, "
        "automatically_declare_parameters_from_overrides=False, enable_logger_service=False)",
        _NODE,
    ),
    "rclpy.node.Node.get_name": ("(self)", _NODE),
    "rclpy.node.Node.get_namespace": ("(self)", _NODE),
    "rclpy.node.Node.get_node_names_and_namespaces": ("(self)", _NODE),
    "rclpy.node.Node.get_fully_qualified_name": ("(self)", _NODE),
    "rclpy.node.Node.get_topic_names_and_types": ("(self, no_demangle=False)", _NODE),
    "rclpy.node.Node.resolve_topic_name": ("(self, topic, *, only_expand=False)", _NODE),
    "rclpy.node.Node.get_clock": ("(self)", _NODE),
    "rclpy.node.Node.get_logger": ("(self)", _NODE),
    "rclpy.node.Node.create_publisher": (
        "(self, msg_type, topic, qos_profile, *, callback_group=None, event_callbacks=None, "
        "qos_overriding_options=None, publisher_class=...)",
        _NODE,
    ),
    "rclpy.node.Node.create_subscription": (
        "(self, msg_type, topic, callback, qos_profile, *, callback_group=None, "
        "event_callbacks=None, qos_overriding_options=None, raw=False)",
        _NODE,
    ),
    "rclpy.node.Node.create_service": (
        "(self, srv_type, srv_name, callback, *, qos_profile=..., callback_group=None)",
        _NODE,
    ),
    "rclpy.node.Node.create_timer": (
        "(self, timer_period_sec, callback, callback_group=None, clock=None, autostart=True)",
        _NODE,
    ),
    "rclpy.node.Node.destroy_publisher": ("(self, publisher)", _NODE),
    "rclpy.node.Node.destroy_subscription": ("(self, subscription)", _NODE),
    "rclpy.node.Node.destroy_service": ("(self, service)", _NODE),
    "rclpy.node.Node.destroy_timer": ("(self, timer)", _NODE),
    "rclpy.node.Node.destroy_node": ("(self)", _NODE),
    "rclpy.node.Node.has_parameter": ("(self, name)", _NODE),
    "rclpy.node.Node.get_parameter": ("(self, name)", _NODE),
    "rclpy.node.Node.declare_parameter": (
        "(self, name, value=None, descriptor=None, ignore_override=False)",
        _NODE,
    ),
    "rclpy.node.Node.add_on_set_parameters_callback": ("(self, callback)", _NODE),
    "rclpy.node.Node.remove_on_set_parameters_callback": ("(self, callback)", _NODE),
    "rclpy.lifecycle.LifecycleNode": (
        "(node_name, *, enable_communication_interface=True, **kwargs)",
        _LIFECYCLE,
    ),
    "rclpy.lifecycle.LifecycleNode.on_configure": ("(self, state)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.on_cleanup": ("(self, state)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.on_activate": ("(self, state)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.on_deactivate": ("(self, state)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.on_shutdown": ("(self, state)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.on_error": ("(self, state)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.trigger_configure": ("(self)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.trigger_cleanup": ("(self)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.trigger_activate": ("(self)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.trigger_deactivate": ("(self)", _LIFECYCLE),
    "rclpy.lifecycle.LifecycleNode.trigger_shutdown": ("(self)", _LIFECYCLE),
    "rclpy.executors.MultiThreadedExecutor": ("(num_threads=None, *, context=None)", _EXECUTORS),
    "rclpy.executors.MultiThreadedExecutor.add_node": ("(self, node)", _EXECUTORS),
    "rclpy.executors.MultiThreadedExecutor.spin": ("(self)", _EXECUTORS),
    "rclpy.executors.MultiThreadedExecutor.shutdown": ("(self, timeout_sec=None)", _EXECUTORS),
    "rclpy.executors.SingleThreadedExecutor": ("(*, context=None)", _EXECUTORS),
    "rclpy.executors.SingleThreadedExecutor.add_node": ("(self, node)", _EXECUTORS),
    "rclpy.executors.SingleThreadedExecutor.spin": ("(self)", _EXECUTORS),
    "rclpy.executors.SingleThreadedExecutor.shutdown": ("(self, timeout_sec=None)", _EXECUTORS),
    "rclpy.callback_groups.MutuallyExclusiveCallbackGroup": (
        "()",
        "rclpy/rclpy/callback_groups.py",
    ),
    "rclpy.callback_groups.ReentrantCallbackGroup": ("()", "rclpy/rclpy/callback_groups.py"),
    "rclpy.clock.Clock": ("(*, clock_type=...)", _CLOCK),
    "rclpy.clock.JumpThreshold": ("(*, min_forward, min_backward, on_clock_change=True)", _CLOCK),
    "rclpy.duration.Duration": ("(*, seconds=0, nanoseconds=0)", "rclpy/rclpy/duration.py"),
    "rclpy.time.Time": (
        "(*, seconds=0, nanoseconds=0, clock_type=...)",
        "rclpy/rclpy/time.py",
    ),
    "rclpy.qos.QoSProfile": ("(**kwargs)", "rclpy/rclpy/qos.py, 02fc987"),
    "tf2_ros.Buffer": (
        "(cache_time=None, node=None)",
        "tf2_ros_py/tf2_ros/buffer.py, 098d27a",
    ),
    "tf2_ros.Buffer.lookup_transform": (
        "(self, target_frame, source_frame, time, timeout=...)",
        "tf2_ros_py/tf2_ros/buffer.py, 098d27a",
    ),
    "tf2_ros.Buffer.clear": ("(self)", "tf2_py/src/tf2_py.cpp"),
    "tf2_ros.TransformListener": (
        "(buffer, node, *, spin_thread=False, qos=None, static_qos=None, tf_topic='/tf', "
        "tf_static_topic='/tf_static', static_only=False)",
        "tf2_ros_py/tf2_ros/transform_listener.py, 0550b77",
    ),
    "tf2_ros.TransformListener.callback": (
        "(self, data)",
        "tf2_ros_py/tf2_ros/transform_listener.py, 0550b77",
    ),
}

# What no class of the table has, and the module or class that has it.
OTHERS = {
    "Clock.now": ("(self)", _CLOCK),
    "Clock.create_jump_callback": (
        "(self, threshold, *, pre_callback=None, post_callback=None)",
        _CLOCK,
    ),
    "JumpHandle.unregister": ("(self)", _CLOCK),
    "Publisher.publish": ("(self, msg)", "rclpy/rclpy/publisher.py"),
    "Publisher.wait_for_all_acked": ("(self, timeout=...)", "rclpy/rclpy/publisher.py"),
    "Publisher.get_subscription_count": ("(self)", "rclpy/rclpy/publisher.py"),
    "Logger.debug": ("(self, message, **kwargs)", "rclpy/rclpy/impl/rcutils_logger.py, 0184628"),
    "Logger.info": ("(self, message, **kwargs)", "rclpy/rclpy/impl/rcutils_logger.py, 0184628"),
    "Logger.warning": ("(self, message, **kwargs)", "rclpy/rclpy/impl/rcutils_logger.py, 0184628"),
    "Logger.error": ("(self, message, **kwargs)", "rclpy/rclpy/impl/rcutils_logger.py, 0184628"),
}
